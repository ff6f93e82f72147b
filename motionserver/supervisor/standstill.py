"""Do planner and page still do anything? What lives and stands still is replaced."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Final

POLL: Final = 0.5
"""Time between two looks [s]."""
PATIENCE: Final = 10.0
"""Who has shown itself and then has not for so long stands still [s]; a planner that does has
parked the platform long before."""
LOADING: Final = 60.0
"""How long one that was just started may take to show itself [s]; twice as long after each one
that was ended before it did."""
REMIND: Final = 15.0
"""Time between two words about one that is still loading [s]."""
_LATE: Final = 3.0 * POLL
"""Looks further apart say nothing: we stood as well."""


@dataclass(frozen=True, slots=True)
class Activity:
    """What the kernel says of a process.

    Attributes:
        processor_s: Processor time used so far [s].
        is_held_up: True if it waits for the processor or the disk, which is not its own fault.
    """

    processor_s: float = 0.0
    is_held_up: bool = False


IDLE: Final = Activity()


def activity_of(pid: int) -> Activity:
    """Read it from /proc; a process that is gone is idle."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text("ascii", "replace")
    except OSError:
        return IDLE
    # behind the name, which may hold anything: state is the third field, utime the 14th
    fields = text.rpartition(")")[2].split()
    ticks = int(fields[11]) + int(fields[12])
    return Activity(ticks / os.sysconf("SC_CLK_TCK"), fields[0] in "RD")


class Standstill:
    """Judges one process by a number that it counts up while it does its work.

    A process that is held up by the machine is judged by the processor time that it used, so
    that a slow or busy computer is not taken for a process that stands still.

    Attributes:
        loading: How long the process has been loading, by the clock [s]; None once it has shown
            itself, and without a process.
        used: Processor time that it used for that [s].
    """

    def __init__(self) -> None:
        self._pid: int | None = None
        self._sign = 0
        self._looked = 0.0
        self._stood = 0.0
        self._processor = 0.0
        self._has_shown = False
        self._ended_loading = 0
        self.loading: float | None = None
        self.used = 0.0
        self._reminded = 0.0

    def look(self, now: float, pid: int | None, sign: int, activity: Activity = IDLE) -> bool:
        """Look once.

        Args:
            now: Monotonic time [s].
            pid: The process; None while there is none.
            sign: What it counts up.
            activity: What the kernel says of it.

        Returns:
            True if it stands still; then it is watched anew.
        """
        elapsed, self._looked = now - self._looked, now
        worked = max(0.0, activity.processor_s - self._processor)
        self._processor = activity.processor_s
        if pid != self._pid or sign != self._sign:
            self._note(pid, sign)
            return False
        if pid is None or elapsed > _LATE:
            return False
        self._stood += min(elapsed, worked) if activity.is_held_up else elapsed
        if self.loading is not None:
            self.loading += elapsed
            self.used += worked
        if self._stood < self.patience:
            return False
        self._ended_loading += 0 if self._has_shown else 1
        self._stood = 0.0
        return True

    def still_loading(self) -> str:
        """What to say of a process that has not shown itself yet; empty until it is time to."""
        if self.loading is None or self.loading - self._reminded < REMIND:
            return ""
        self._reminded = self.loading
        return (
            f"is still loading, {self.loading:.0f} s after its start and with {self.used:.1f} s of "
            f"processor time; ended after {self.patience:.0f} s without progress"
        )

    @property
    def patience(self) -> float:
        """How long it may go on without a sign [s]."""
        return PATIENCE if self._has_shown else LOADING * 2.0**self._ended_loading

    def _note(self, pid: int | None, sign: int) -> None:
        """Another process, or a sign of this one."""
        is_new = pid != self._pid
        self._has_shown = not is_new
        if self._has_shown:
            self._ended_loading = 0
        self._pid, self._sign, self._stood = pid, sign, 0.0
        self.loading = 0.0 if is_new and pid is not None else None
        self.used = self._reminded = 0.0
