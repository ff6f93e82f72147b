"""One child process: started by exec, watched, started again when it dies."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import sys
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from motionserver.telemetry.parent import PARENT
from motionserver.telemetry.signals import held_back
from motionserver.telemetry.ticker import now_ns

QUICK: Final = 5.0
"""A child that lived shorter than this is started again more slowly [s]."""
SLOWEST: Final = 2.0
"""Longest pause before a start [s]."""

log = logging.getLogger("motionserver.supervisor")
_starting: Final = asyncio.Lock()
"""One start at a time: the mask of signals is the process's."""


@dataclass(slots=True)
class Child:
    """A process that shall run.

    Attributes:
        name: Shown name.
        arguments: After ``python``.
        descriptors: File descriptors it inherits.
        told: Environment variables of its own.
        opens_signals: True for a program that lets its signals through itself, see
            `telemetry.signals`: until then they wait.
        wanted: False once it shall not be started again.
        restarts: How often it was started again.
        exits: Exit status of each life.
        deaths: Newest ends that nobody wanted: instant [ns], exit status, process id.
        may_start: Asked before each start after the first; it waits while the answer is no.
    """

    name: str
    arguments: tuple[str, ...]
    descriptors: tuple[int, ...] = ()
    told: dict[str, str] = field(default_factory=dict)
    opens_signals: bool = False
    wanted: bool = True
    restarts: int = 0
    exits: list[int] = field(default_factory=list)
    deaths: deque[tuple[int, int, int]] = field(default_factory=lambda: deque(maxlen=8))
    may_start: Callable[[], bool] = lambda: True
    _process: asyncio.subprocess.Process | None = None

    @property
    def pid(self) -> int | None:
        """Its process id while it lives."""
        process = self._process
        return process.pid if process is not None and process.returncode is None else None

    async def keep(self) -> None:
        """Start it, and again whenever it ends, until it is not wanted any more."""
        pause = 0.0
        while self.wanted:
            began = time.monotonic()
            process = await self.start()
            status = await process.wait()
            self.exits.append(status)
            if self.wanted:
                self.deaths.append((now_ns(), status, process.pid))
            quick = time.monotonic() - began < QUICK
            pause = min(SLOWEST, max(0.1, 2.0 * pause)) if quick else 0.0
            await self._wait_to_restart(status, pause)

    async def _wait_to_restart(self, status: int, pause: float) -> None:
        if not self.wanted:
            return
        self.restarts += 1
        log.warning("%s ended with %s; starting it again", self.name, status)
        if self.restarts > 1 and pause:
            await asyncio.sleep(pause)
        while self.wanted and not self.may_start():  # noqa: ASYNC110  (another process decides)
            await asyncio.sleep(0.05)

    async def ended(self, patience: float) -> int:
        """Wait for its end, at most ``patience`` [s]; its exit status, 0 if it never lived.

        Raises:
            TimeoutError: It lives on.
        """
        process = self._process
        return 0 if process is None else await asyncio.wait_for(process.wait(), patience)

    async def start(self, *more: str) -> asyncio.subprocess.Process:
        """Start it once, with ``more`` arguments behind its own."""
        environment = {**os.environ, **self.told, PARENT: str(os.getpid())}
        # one thread per process: a solver that spreads over the cores disturbs the guard
        for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
            environment.setdefault(name, "1")
        async with _starting:
            # until it has handlers of its own no signal ends it: they wait, or stay ignored
            with held_back() if self.opens_signals else contextlib.nullcontext():
                process = await asyncio.create_subprocess_exec(
                    sys.executable,
                    *self.arguments,
                    *more,
                    pass_fds=self.descriptors,
                    env=environment,
                    stdin=asyncio.subprocess.DEVNULL,
                    restore_signals=False,
                    # Ctrl-C is the supervisor's: it parks first, then tells the others
                    process_group=0,
                )
        self._process = process
        return process

    def signal(self, number: int) -> None:
        """Send a signal, if it lives."""
        if self.pid is not None and self._process is not None:
            self._process.send_signal(number)

    async def end(self, number: int, patience: float) -> None:
        """Ask it to end, kill it after ``patience`` [s]."""
        self.wanted = False
        process = self._process
        if process is None or process.returncode is not None:
            return
        self.signal(number)
        try:
            await asyncio.wait_for(process.wait(), patience)
        except TimeoutError:
            process.kill()
            await process.wait()
