"""Entry of the guard process: ``python -m motionserver.guard RUN_DIR SOCKET_FD [leave]``."""

from __future__ import annotations

import asyncio
import contextlib
import fcntl
import gc
import os
import signal
import sys
from pathlib import Path
from typing import Final

from motionserver.guard.loop import GuardLoop
from motionserver.guard.options import read_options
from motionserver.guard.ports import open_link
from motionserver.telemetry.log_output import start_log
from motionserver.telemetry.memory import lock_memory
from motionserver.telemetry.oom import GUARD, set_oom_score
from motionserver.telemetry.parent import follow_parent
from motionserver.telemetry.realtime import take_priority
from motionserver.telemetry.run_files import located
from motionserver.telemetry.signals import ignore_signals, let_through

LOCK = "guard.lock"
"""Whoever holds it moves the platform."""
NEXT = "spare.lock"
"""Whoever holds it is next; the reserve waits for it."""
PRIORITY: Final = 50
"""SCHED_FIFO priority: the guard comes before the planner."""


def main() -> int:
    """Wait for the guard's lock, then run: the second process started is a warm spare.

    A spare that is told to end while it waits remembers it: it parks if its turn comes, since
    the guard before it may have died while parking.
    """
    told: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, _: told.append(number))
    ignore_signals(but=(signal.SIGTERM,))
    let_through()
    follow_parent()
    run_dir, descriptor = Path(sys.argv[1]), int(sys.argv[2])
    options = read_options(run_dir)
    link = open_link(descriptor)
    # before it waits: a spare that must first queue for a busy processor takes over late
    scheduling = take_priority(PRIORITY, options.realtime)
    start_log(prepare_thread=lambda: take_priority(PRIORITY, options.realtime))
    gc.collect()
    gc.freeze()
    memory = f"{lock_memory(options.realtime)}, {set_oom_score(GUARD)}"
    turn, lock = _opened(run_dir, NEXT), _opened(run_dir, LOCK)
    try:
        # one after the other: which guard takes over is no matter of chance
        fcntl.flock(turn, fcntl.LOCK_EX)
        # the service tells by it who is next
        _note(turn, f"{os.getpid():<8}".encode())
        fcntl.flock(lock, fcntl.LOCK_EX)
        os.close(turn)
        ended = os.pread(lock, 8, 0).strip()
        if told and ended:
            # the guard before it parked and left in order: nothing remains to be done
            return int(ended)
        _note(lock, b" ")
        loop = GuardLoop(options, run_dir, link, f"{scheduling}, {memory}")
        signal.signal(signal.SIGTERM, lambda *_: loop.ask_to_leave("terminated"))
        if told or sys.argv[3:] == ["leave"]:
            loop.ask_to_leave("told before its turn came")
        status = asyncio.run(loop.run())
        _note(lock, str(status).encode())
        return status
    finally:
        os.close(lock)


def _opened(run_dir: Path, name: str) -> int:
    return os.open(located(run_dir, name), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)


def _note(lock: int, text: bytes) -> None:
    """Write over the beginning of a lock's file; where that fails, nobody is kept from ending."""
    with contextlib.suppress(OSError):
        os.pwrite(lock, text, 0)


if __name__ == "__main__":
    sys.exit(main())
