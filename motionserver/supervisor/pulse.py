"""Is the guard alive? Its clock must advance; a machine that stalls altogether proves nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Final

POLL: Final = 0.01
"""Time between two looks [s]."""
FROZEN: Final = 0.06
"""A guard whose clock has stood for so long, while the looks came in time, is frozen [s]: its
successor still goes on with the next sample."""
STARVED: Final = 0.25
"""The same for a guard that could run if the processor were free [s]: a busy machine is not a
frozen guard."""
_LATE: Final = 2.5
"""Looks further apart than so many `POLL` say nothing about the guard: we stood as well."""


class Pulse:
    """Judges one guard by the instant it writes at every send.

    Attributes:
        written_ns: What it had written at the look before [ns].
    """

    def __init__(self) -> None:
        self._pid: int | None = None
        self.written_ns = 0
        self._looked = 0.0
        self._stood = 0.0

    def look(self, now: float, pid: int | None, written_ns: int, runnable: bool = False) -> bool:
        """Look once.

        Args:
            now: Monotonic time [s].
            pid: The guard that holds the lock, by its own word.
            written_ns: When it last wrote its clock [ns]; 0 = never.
            runnable: True if it only waits for the processor.

        Returns:
            True if it is frozen; then it is watched anew.
        """
        elapsed, self._looked = now - self._looked, now
        if pid is None or pid != self._pid or written_ns != self.written_ns or not written_ns:
            self._pid, self.written_ns, self._stood = pid, written_ns, 0.0
            return False
        if elapsed > _LATE * POLL:
            return False
        self._stood += elapsed
        if self._stood < (STARVED if runnable else FROZEN):
            return False
        self._stood = 0.0
        return True


def is_runnable(pid: int) -> bool:
    """Whether a process runs, or would if it got the processor; not if it sleeps or is stopped."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text("ascii", "replace")
    except OSError:
        return False
    return text.rpartition(")")[2].split()[:1] == ["R"]
