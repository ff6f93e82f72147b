"""A whole server for a benchmark: the real processes, an emulated base, a cue on loopback."""

from __future__ import annotations

import json
import socket
import subprocess
import tempfile
import time
from contextlib import ExitStack, suppress
from math import ceil
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import tomli_w

from motionserver.evaluate.bench.processes import BenchError, Helper, free_port, tail_of
from motionserver.telemetry.link import Maps
from motionserver.telemetry.requests import RequestError, ask

RAISING: Final = 30.0
"""Longest wait for the platform to run [s]."""
PARKING: Final = 60.0
"""Longest wait for it to park and end [s]."""
FASTEST_PLANNER_HZ: Final = 100.0
"""What ``rate_max_hz`` of its configuration says [Hz]."""
OTHERS_PRIORITY: Final = 20
"""For SCHED_FIFO of base and simulator, if permitted: they have computers of their own."""


class BenchServer:
    """A running server on loopback; use it as a context.

    Args:
        rate_hz: Packets per second of the platform [Hz].
        realtime: Whether its processes ask for SCHED_FIFO.
        key: What the cues are signed with; empty for unsigned ones.

    Attributes:
        plan_hz: Plans per second that are due at this rate [Hz].
        cue_port: UDP port of the cue.
        platform_port: UDP port on which it hears the base.
        web_port: TCP port of the page.
        base_log: What the base received, with instants.
        verdict: What the base's judge saw, once the context has been left.
    """

    def __init__(self, rate_hz: float, realtime: bool, key: bytes = b"") -> None:
        self.rate_hz, self.realtime, self._key = rate_hz, realtime, key
        self.plan_hz = rate_hz / ceil(rate_hz / FASTEST_PLANNER_HZ)
        self.cue_port = free_port(socket.SOCK_DGRAM)
        self.platform_port = free_port(socket.SOCK_DGRAM)
        self.web_port = free_port(socket.SOCK_STREAM)
        self.verdict: dict[str, Any] = {}
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        """Start everything and wait until the base stands parked."""
        with ExitStack() as stack:
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="bench-")))
            self._folder, self.base_log = folder, folder / "base.log"
            base_port = free_port(socket.SOCK_DGRAM)
            arguments = (str(base_port), str(self.rate_hz), str(self.base_log))
            self._base = stack.enter_context(
                Helper("motionserver.evaluate.bench.base", *arguments, fifo=OTHERS_PRIORITY)
            )
            self._base.line()
            config = folder / "server.toml"
            config.write_text(tomli_w.dumps(self._config(base_port)), "utf-8")
            log = stack.enter_context((folder / "server.log").open("wb"))
            self._server = stack.enter_context(
                Helper("motionserver", "run", str(config), stdout=log, stderr=log)
            )
            self._maps = self._opened()
            self._until("PARKED", 15.0)
            self._stack = stack.pop_all()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Park, end, and take everything away."""
        with self._stack:
            if kind is None:
                self.stop()

    def stop(self) -> None:
        """Park, end, and hear the judge; what was logged stays until the context is left.

        Raises:
            BenchError: The server had ended by itself: what was measured was no server.
        """
        if self.verdict:
            return
        fallen = self._server.process.poll()
        self._server.end(PARKING)
        self._base.process.terminate()
        self.verdict = self._base.result()
        if fallen is not None:
            raise BenchError(f"bench: the server ended by itself, status {fallen}; {self._tail()}")

    def replay(self, recording: str) -> Helper:
        """Send a recording round and round, as a simulator would; end it yourself."""
        to = f"127.0.0.1:{self.cue_port}"
        arguments = ("replay", recording, "--to", to, "--loop")
        return Helper("motionserver", *arguments, stdout=subprocess.DEVNULL, fifo=OTHERS_PRIORITY)

    def engage(self) -> None:
        """Raise the platform once a cue comes, and wait until it runs; a fault is reset.

        Raises:
            BenchError: It does not run in time.
        """
        deadline = time.monotonic() + RAISING
        state, reason = "", "no cue has come"
        while time.monotonic() < deadline and self._server.process.poll() is None:
            state = str(self.guard().get("state"))
            if state == "RUN":
                return
            # a busy computer may let the emulated base starve while it rises
            op = {"PARKED": "engage", "FAULT": "reset"}.get(state)
            if op is not None:
                try:
                    request = {"op": op, "by": "console"}
                    reason = str(ask(self.run_dir / "guard.sock", request)["reason"])
                except RequestError as error:
                    reason = str(error)
            time.sleep(0.1)
        raise BenchError(
            f"bench: the platform does not run ({state}: {reason}) within {RAISING:g} s; "
            f"{self._tail()}"
        )

    def await_page(self) -> None:
        """Wait until the page answers; it starts last, and below everybody.

        Raises:
            BenchError: It does not.
        """
        deadline = time.monotonic() + RAISING
        while time.monotonic() < deadline and self._server.process.poll() is None:
            with suppress(OSError), socket.create_connection(("127.0.0.1", self.web_port), 1.0):
                return
            time.sleep(0.1)
        raise BenchError(f"bench: no page within {RAISING:g} s; {self._tail()}")

    def guard(self) -> dict[str, Any]:
        """The guard's newest snapshot."""
        message = self._maps.guard.read()
        return {} if message is None else dict(json.loads(message[1]))

    def planner(self) -> dict[str, Any]:
        """The planner's newest snapshot."""
        message = self._maps.planner.read()
        return {} if message is None else dict(json.loads(message[1]))

    @property
    def run_dir(self) -> Path:
        """Where its processes meet."""
        return self._folder / "run"

    def _until(self, state: str, patience: float) -> None:
        deadline = time.monotonic() + patience
        found = None
        while time.monotonic() < deadline and self._server.process.poll() is None:
            found = self.guard().get("state")
            if found == state:
                return
            time.sleep(0.02)
        raise BenchError(
            f"bench: {state} expected within {patience:g} s, the server is {found}; {self._tail()}"
        )

    def _opened(self) -> Maps:
        deadline = time.monotonic() + 10.0
        while time.monotonic() < deadline and self._server.process.poll() is None:
            try:
                return Maps(self.run_dir)
            except (OSError, ValueError):
                time.sleep(0.02)
        raise BenchError(f"bench: the server does not start; {self._tail()}")

    def _tail(self) -> str:
        return "the end of its log:\n" + tail_of(self._folder / "server.log")

    def _config(self, base_port: int) -> dict[str, Any]:
        source = {"kind": "native", "listen": f"127.0.0.1:{self.cue_port}"}
        if self._key:
            file = self._folder / "key"
            file.touch(mode=0o600)
            file.write_bytes(self._key)
            source["key_file"] = str(file)
        return {
            "server": {
                "run_dir": str(self.run_dir),
                "state_dir": str(self._folder / "state"),
                "realtime": self.realtime,
            },
            "platform": {
                "port": base_port,
                "local_port": self.platform_port,
                "rate_hz": float(self.rate_hz),
            },
            "sources": [source],
            "cueing": {"rate_max_hz": FASTEST_PLANNER_HZ},
            "web": {"port": self.web_port},
        }
