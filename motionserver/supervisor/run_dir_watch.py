"""Is the run directory still there? Without it nobody can ask the guard for anything."""

from __future__ import annotations

import logging
import os
from pathlib import Path
from typing import Final

from motionserver.telemetry.run_files import RunFiles

POLL: Final = 0.25
"""Time between two looks [s]."""
NEEDED: Final = ("service.lock", "guard.sock")
"""Without them another server may start there, and no operator is heard."""
_SOCKET_OF_TUNING: Final = "planner.sock"

log = logging.getLogger("motionserver.supervisor")


class RunDirWatch:
    """Looks after one run directory; what can be put back is put back.

    Args:
        run_dir: The directory, as it is now.
        files: Its files in memory.
    """

    def __init__(self, run_dir: Path, files: RunFiles) -> None:
        self._run_dir, self._files = run_dir, files
        self._identity = _identity(run_dir)
        self._seen: set[str] = set()
        self._missing: set[str] = set()

    def look(self) -> str:
        """Look once.

        Returns:
            What is lost for good, in words; empty if nothing is.
        """
        if _identity(self._run_dir) != self._identity:
            return f"the run directory {self._run_dir} was removed"
        watched = (*NEEDED, _SOCKET_OF_TUNING)
        there = {name for name in watched if os.path.lexists(self._run_dir / name)}
        # a process that starts puts its socket in the place of the one before
        lost = (self._seen - there) & self._missing
        self._missing = self._seen - there
        self._seen |= there
        for name in sorted(lost & set(NEEDED)):
            return f"{self._run_dir / name} was removed"
        if lost:
            self._seen -= lost
            log.warning(
                "%s was removed: no tuning until the next start", self._run_dir / _SOCKET_OF_TUNING
            )
        if repaired := self._files.repair_links():
            log.warning("put back in %s: %s", self._run_dir, ", ".join(sorted(repaired)))
        return ""


def _identity(path: Path) -> tuple[int, int] | None:
    try:
        about = path.stat()
    except OSError:
        return None
    return about.st_dev, about.st_ino
