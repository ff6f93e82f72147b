"""Log output of a process that moves the platform: no caller waits for a terminal, pipe or disk.

A terminal stopped by Ctrl-S, a pipe that nobody reads or a disk that hangs makes a write wait for
ever. All processes of a server share one such output, so that guard, spare and reserve would stand
still together. Lines are written by a thread of their own; what it cannot write is counted and left
out, and the count is written as soon as the output takes lines again.
"""

from __future__ import annotations

import contextlib
import logging
import os
import queue
import select
import signal
import sys
import threading
import time
from collections.abc import Callable
from types import TracebackType
from typing import Final

FORMAT: Final = "%(asctime)s %(name)s %(message)s"
MOST_LINES: Final = 2_000
"""Lines kept for an output that takes none; what comes then is left out."""
FLUSH: Final = 0.5
"""Longest time that the end of a process waits for its last lines [s]."""
_POLL: Final = 0.005
_STACK: Final = 256 << 10
"""Enough for a loop that writes; a locked stack of the usual 8 MB may be refused [bytes]."""
_STDERR: Final = 2

log = logging.getLogger("motionserver")


class BackgroundHandler(logging.Handler):
    """Writes lines by a thread; `emit` returns at once whatever the output does."""

    def __init__(
        self,
        descriptor: int = _STDERR,
        prepare_thread: Callable[[], object] = lambda: None,
        most_lines: int = MOST_LINES,
    ) -> None:
        """Start the thread.

        Args:
            descriptor: Where lines are written.
            prepare_thread: Called in the thread before it writes. A process with real-time
                priority asks for the same there: a thread that has the interpreter and no
                processor keeps everybody else waiting.
            most_lines: How many lines wait at most.
        """
        super().__init__()
        self._descriptor, self._prepare, self._most = descriptor, prepare_thread, most_lines
        self._lines: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self._left_out = self._put = self._written = 0
        self.setFormatter(logging.Formatter(FORMAT))
        usual = threading.stack_size(_STACK)
        try:
            threading.Thread(target=self._write_lines, name="log", daemon=True).start()
        finally:
            threading.stack_size(usual)

    def emit(self, record: logging.LogRecord) -> None:
        """Hand a line over, or count it if the output has taken none for long."""
        try:
            line = (self.format(record) + "\n").encode("utf-8", "backslashreplace")
        except Exception:
            # a line that cannot be formatted is a mistake of ours, and no reason to stand still
            line = f"{record.name}: a log line of {record.pathname} cannot be made\n".encode()
        if self._put - self._written >= self._most:
            self._left_out += 1
            return
        self._put += 1
        self._lines.put(line)

    def flush(self) -> None:
        """Wait for what was handed over, `FLUSH` seconds at most."""
        deadline = time.monotonic() + FLUSH
        while self._written < self._put and time.monotonic() < deadline:
            time.sleep(_POLL)

    def _write_lines(self) -> None:
        # signals are the main thread's
        signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())
        self._prepare()
        while True:
            self._write(self._lines.get())
            left_out, self._left_out = self._left_out, 0
            if left_out:
                self._write(f"{left_out} log lines were left out: the output took none\n".encode())
            self._written += 1

    def _write(self, line: bytes) -> None:
        # an output that is gone: nobody can be told
        with contextlib.suppress(OSError):
            while line:
                try:
                    line = line[os.write(self._descriptor, line) :]
                except BlockingIOError:
                    # somebody else has set our terminal or pipe to be non-blocking
                    select.select([], [self._descriptor], [], 1.0)


def start_log(
    level: int | str = logging.INFO, prepare_thread: Callable[[], object] = lambda: None
) -> None:
    """Write the log of this process, its warnings and how it dies, without ever waiting.

    Args:
        level: Lowest level that is written.
        prepare_thread: See `BackgroundHandler`.
    """
    logging.basicConfig(level=level, handlers=[BackgroundHandler(prepare_thread=prepare_thread)])
    logging.captureWarnings(True)
    sys.excepthook = _log_death
    sys.unraisablehook = _log_unraisable


def _log_death(
    kind: type[BaseException], error: BaseException, trace: TracebackType | None
) -> None:
    log.critical("ended by an error", exc_info=(kind, error, trace))


def _log_unraisable(found: sys.UnraisableHookArgs) -> None:
    if (error := found.exc_value) is not None:
        log.error("ignored in %r", found.object, exc_info=error)
