"""Do planner and page still do anything? What lives and stands still is replaced."""

from __future__ import annotations

from typing import Final

POLL: Final = 0.5
"""Time between two looks [s]."""
PATIENCE: Final = 10.0
"""Who has shown itself and then has not for so long stands still [s]; a planner that does has
parked the platform long before."""
LOADING: Final = 60.0
"""How long one that was just started may take to show itself [s]."""
_LATE: Final = 3.0 * POLL
"""Looks further apart say nothing: we stood as well."""


class Standstill:
    """Judges one process by a number that it counts up while it does its work."""

    def __init__(self) -> None:
        self._pid: int | None = None
        self._sign = 0
        self._looked = 0.0
        self._stood = 0.0
        self._has_shown = False

    def look(self, now: float, pid: int | None, sign: int) -> bool:
        """Look once.

        Args:
            now: Monotonic time [s].
            pid: The process; None while there is none.
            sign: What it counts up.

        Returns:
            True if it stands still; then it is watched anew.
        """
        elapsed, self._looked = now - self._looked, now
        if pid != self._pid or sign != self._sign:
            self._has_shown = pid == self._pid
            self._pid, self._sign, self._stood = pid, sign, 0.0
            return False
        if pid is None or elapsed > _LATE:
            return False
        self._stood += elapsed
        if self._stood < (PATIENCE if self._has_shown else LOADING):
            return False
        self._stood = 0.0
        return True
