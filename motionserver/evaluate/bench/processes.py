"""Processes of a benchmark: started by exec, each ends with one line of JSON."""

from __future__ import annotations

import contextlib
import json
import os
import socket
import subprocess
import sys
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Self

from motionserver.errors import MotionServerError


class BenchError(MotionServerError):
    """A benchmark could not be carried out; nothing was measured."""


class Helper:
    """One process of ``python -m MODULE``; use it as a context, it is ended with it.

    Args:
        module: What to run.
        arguments: After it.
        stdout: Where its output goes; a pipe if None, for `ready` and `result`.
        stderr: Where its complaints go; where ours go if None.
        fifo: Priority for SCHED_FIFO, if permitted: for what has a computer of its own in real
            life, and must not be what is measured. 0 leaves it as it is.
        asks: True if it reads lines, see `tell`.
    """

    def __init__(
        self,
        module: str,
        *arguments: str,
        stdout: IO[bytes] | int | None = None,
        stderr: IO[bytes] | int | None = None,
        fifo: int = 0,
        asks: bool = False,
    ) -> None:
        environment = dict(os.environ)
        # as the service does for its own: a matrix product must not spread over the cores
        for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
            environment[name] = "1"
        environment["PYTHONPATH"] = os.pathsep.join(filter(None, sys.path))
        self.module = module
        self.process = subprocess.Popen(
            [sys.executable, "-m", module, *arguments],
            stdin=subprocess.PIPE if asks else subprocess.DEVNULL,
            stdout=subprocess.PIPE if stdout is None else stdout,
            stderr=stderr,
            env=environment,
        )
        if fifo:
            with contextlib.suppress(OSError):
                os.sched_setscheduler(self.process.pid, os.SCHED_FIFO, os.sched_param(fifo))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.end(5.0)

    def tell(self, text: str) -> None:
        """Send it a line."""
        if self.process.stdin is not None:
            self.process.stdin.write(text.encode() + b"\n")
            self.process.stdin.flush()

    def line(self) -> str:
        """Wait for its next line.

        Raises:
            BenchError: It ended without one.
        """
        pipe = self.process.stdout
        text = b"" if pipe is None else pipe.readline()
        if not text:
            raise BenchError(
                f"bench: {self.module} ended with {self.process.wait()} and said nothing; "
                "its complaint stands above"
            )
        return text.decode().strip()

    def result(self) -> dict[str, Any]:
        """Wait for its line of JSON."""
        found = json.loads(self.line())
        if not isinstance(found, dict):
            raise BenchError(f"bench: {self.module} answered something else than an object")
        return found

    def end(self, patience: float) -> int:
        """Ask it to end, kill it after ``patience`` [s]; its exit status."""
        if self.process.poll() is None:
            self.process.terminate()
        try:
            self.process.wait(patience)
        except subprocess.TimeoutExpired:
            self.process.kill()
        status = self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):
                    pipe.close()
        return status


def say(message: object) -> None:
    """Answer the process that started this one: a word, or an object as JSON."""
    text = message if isinstance(message, str) else json.dumps(message)
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def free_port(kind: socket.SocketKind, wanted: int = 0) -> int:
    """A port of 127.0.0.1 that nobody holds now: the wanted one, if that is free."""
    with socket.socket(socket.AF_INET, kind) as probe:
        try:
            probe.bind(("127.0.0.1", wanted))
        except OSError:
            probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def tail_of(path: Path, lines: int = 5) -> str:
    """The end of a log, for a complaint."""
    try:
        return "\n".join(path.read_text("utf-8", "replace").splitlines()[-lines:])
    except OSError as error:
        return str(error)
