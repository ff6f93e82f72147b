"""The guard that moves the platform, and the two that wait to take its place."""

from __future__ import annotations

import asyncio
import json
import logging
import os
import signal
from collections.abc import Sequence
from typing import Final

from motionserver.supervisor.child import Child
from motionserver.supervisor.contents import GUARD_LOCK, LOCK_BYTES, SPARE_LOCK
from motionserver.telemetry.link import Maps
from motionserver.telemetry.run_files import RunFiles

GUARDS: Final = ("guard", "spare guard", "reserve guard")
"""The reserve steps in when guard and spare die together."""
PARK_PATIENCE: Final = 90.0
"""Longest wait for the guard to park when the service ends [s]."""

log = logging.getLogger("motionserver.supervisor")


class GuardGroup:
    """The guards of one service.

    Args:
        children: Their processes.
        maps: By which the active one tells who it is.
        files: Among them the lock by which the spare does.
    """

    def __init__(self, children: Sequence[Child], maps: Maps, files: RunFiles) -> None:
        self.children = tuple(children)
        self._maps = maps
        self._spare_lock = files.descriptors[SPARE_LOCK]
        self._guard_lock = files.descriptors[GUARD_LOCK]

    @property
    def active(self) -> Child:
        """The guard that moves the platform, by its own word."""
        return self.in_order()[0]

    def in_order(self) -> list[Child]:
        """The active one, the spare, then who waits to be the spare."""
        message = self._maps.guard.read()
        active = None if message is None else json.loads(message[1])["pid"]
        spare = os.pread(self._spare_lock, LOCK_BYTES, 0).strip()

        def rank(guard: Child) -> int:
            if guard.pid is None:
                return 2
            return 0 if guard.pid == active else 1 if str(guard.pid).encode() == spare else 2

        return sorted(self.children, key=rank)

    @property
    def has_ended(self) -> bool:
        """Whether the last active guard has noted its exit status: nothing moves any more."""
        return bool(os.pread(self._guard_lock, LOCK_BYTES, 0).strip())

    async def park(self) -> int:
        """Let the active guard park; the others are told too, and park if their turn comes.

        Returns:
            0 if it ended parked, 3 if not.
        """
        guards = self.in_order()
        for guard in guards:
            guard.wanted = False
            guard.signal(signal.SIGTERM)
        deadline = asyncio.get_running_loop().time() + PARK_PATIENCE
        result = 3
        while (left := deadline - asyncio.get_running_loop().time()) > 0.0:
            try:
                status = await guards[0].ended(left)
            except TimeoutError:
                break
            if status in (0, 3):
                result = status
                break
            log.warning("%s ended with %s while parking; another parks", guards[0].name, status)
            guards = [*guards[1:], guards[0]]
            if not any(guard.pid for guard in guards):
                await guards[0].start("leave")
        await asyncio.gather(*(guard.end(signal.SIGKILL, 1.0) for guard in guards))
        return result
