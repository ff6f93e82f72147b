"""Everything that is tried or measured instead of read; the machine's own time passes here."""

from __future__ import annotations

import ctypes
import time
from dataclasses import dataclass
from typing import Final

from motionserver.doctor.timing import Sleep
from motionserver.evaluate.bench.sentinel import Sentinel
from motionserver.telemetry.histogram import Histogram

GUARD_PRIORITY: Final = 50
"""What the guard asks for with SCHED_FIFO."""
_TIMEX: Final = 256
"""Bytes that hold a struct timex anywhere; its first word, modes, is 0: ask, change nothing."""
_UNSYNCHRONISED: Final = 5


@dataclass(frozen=True, slots=True)
class ClockOfDay:
    """The clock of day.

    Attributes:
        seconds: Since 1970 [s].
        synchronised: Whether the kernel believes it is set from outside; None if it does not say.
    """

    seconds: float
    synchronised: bool | None


def sleep_beside(rate_hz: float, seconds: float, realtime: bool) -> Sleep:
    """Let a process sleep on the guard's grid, with the priority the guard asks for.

    Args:
        rate_hz: Of the grid [Hz].
        seconds: How long [s].
        realtime: False asks for no priority, as [server] realtime = false does.

    Raises:
        BenchError: It could not be started.
    """
    with Sentinel(1.0 / rate_hz, seconds, GUARD_PRIORITY if realtime else 0) as sentinel:
        seen = sentinel.result()
    late = Histogram.from_mapping(seen["late_bins"])
    return Sleep(rate_hz, seconds, late, int(seen["missed"]), str(seen["scheduling"]))


def clock_of_day() -> ClockOfDay:
    """Read the clock of day, and ask the kernel whether it is kept from outside."""
    asked = ctypes.create_string_buffer(_TIMEX)
    state = ctypes.CDLL(None, use_errno=True).adjtimex(asked)
    return ClockOfDay(time.time(), None if state < 0 else state != _UNSYNCHRONISED)


def timer_resolution() -> float:
    """Resolution of CLOCK_MONOTONIC [s]."""
    return time.clock_getres(time.CLOCK_MONOTONIC)
