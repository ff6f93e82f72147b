"""Is the guard alive? Its clock must advance; a machine that stalls altogether proves nothing."""

from __future__ import annotations

from typing import Final

POLL: Final = 0.02
"""Time between two looks [s]."""
FROZEN: Final = 0.2
"""A guard whose clock has stood for so long, while the looks came in time, is frozen [s]. Shorter
would take a busy machine for a frozen guard, and its successor parks."""
_LATE: Final = 2.5
"""Looks further apart than so many `POLL` say nothing about the guard: we stood as well."""


class Pulse:
    """Judges one guard by the instant it writes at every send."""

    def __init__(self) -> None:
        self._pid: int | None = None
        self._written = 0
        self._looked = 0.0
        self._stood = 0.0

    def look(self, now: float, pid: int | None, written_ns: int) -> bool:
        """Look once.

        Args:
            now: Monotonic time [s].
            pid: The guard that holds the lock, by its own word.
            written_ns: When it last wrote its clock [ns]; 0 = never.

        Returns:
            True if it is frozen; then it is watched anew.
        """
        elapsed, self._looked = now - self._looked, now
        if pid is None or pid != self._pid or written_ns != self._written or not written_ns:
            self._pid, self._written, self._stood = pid, written_ns, 0.0
            return False
        if elapsed > _LATE * POLL:
            return False
        self._stood += elapsed
        if self._stood < FROZEN:
            return False
        self._stood = 0.0
        return True
