"""Ticks on an absolute grid: a timerfd on the asyncio loop.

asyncio's own timers are rounded to whole milliseconds; a timerfd registered as a reader is still
plain asyncio and wakes within tens of microseconds. Python has it from 3.13 on, so here it is
called through ctypes.
"""

from __future__ import annotations

import asyncio
import ctypes
import os
import time
from collections.abc import Callable
from math import ceil
from typing import Final

from motionserver.telemetry.histogram import Histogram

_CLOCK_MONOTONIC: Final = 1
_NONBLOCK_CLOEXEC: Final = os.O_NONBLOCK | os.O_CLOEXEC
_ABSOLUTE: Final = 1
_libc: Final = ctypes.CDLL(None, use_errno=True)


class _Timespec(ctypes.Structure):
    _fields_ = (("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long))


class _Timer(ctypes.Structure):
    _fields_ = (("interval", _Timespec), ("value", _Timespec))


_settime: Final = _libc.timerfd_settime
_settime.argtypes = (ctypes.c_int, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)


SLOWEST_TICK_HZ: Final = 240.0
"""A guard ticks no slower than this [Hz]."""


def ticks_per_send(rate_hz: float) -> int:
    """Ticks of a guard between two packets of a platform that gets ``rate_hz`` of them [Hz]."""
    return max(1, ceil((SLOWEST_TICK_HZ - 1e-6) / rate_hz))


class Ticker:
    """Calls back once per wake-up at absolute instants of CLOCK_MONOTONIC."""

    def __init__(self, callback: Callable[[], None]) -> None:
        self._callback = callback
        self._descriptor = _libc.timerfd_create(_CLOCK_MONOTONIC, _NONBLOCK_CLOEXEC)
        if self._descriptor < 0:
            raise OSError(ctypes.get_errno(), "timerfd_create")
        # made once: a structure and a pointer for every tick cost more than the call
        self._timer = _Timer()
        self._pointer = ctypes.byref(self._timer)
        asyncio.get_running_loop().add_reader(self._descriptor, self._wake)

    def arm(self, instant_ns: int) -> None:
        """Wake once at ``instant_ns``; at once if it has passed."""
        value = self._timer.value
        value.seconds, value.nanoseconds = divmod(max(instant_ns, 1), 1_000_000_000)
        if _settime(self._descriptor, _ABSOLUTE, self._pointer, None) < 0:
            raise OSError(ctypes.get_errno(), "timerfd_settime")

    def _wake(self) -> None:
        try:
            os.read(self._descriptor, 8)
        except BlockingIOError:
            return
        self._callback()

    def close(self) -> None:
        """Stop."""
        asyncio.get_running_loop().remove_reader(self._descriptor)
        os.close(self._descriptor)


class Lateness:
    """How late ticks were, lately and since the start, and how many slots were lost.

    Args:
        period_ns: Time between two ticks [ns].
        keep: "Lately" is the last ``keep`` to ``2 keep`` ticks.
    """

    def __init__(self, period_ns: int, keep: int = 1024) -> None:
        self._period_ns = period_ns
        self._keep = keep
        self._all, self._before, self._now = Histogram(), Histogram(), Histogram()
        self._max_before = self._max_now = self._in_now = 0
        self.missed = 0
        self.ticks = 0

    def ticked(self, late_ns: int) -> None:
        """Note one tick; a whole period late is a lost slot."""
        if self._in_now == self._keep:
            self._before, self._max_before = self._now, self._max_now
            self._now, self._max_now, self._in_now = Histogram(), 0, 0
        self._all.add(late_ns)
        self._now.add(late_ns)
        self._in_now += 1
        self._max_now = max(self._max_now, late_ns)
        self.ticks += 1
        self.missed += max(0, late_ns // self._period_ns)

    def summary(self) -> dict[str, float | dict[str, int]]:
        """Percentiles [ms], lost slots, and the histogram behind them.

        p50, p99 and the largest are of the last ticks; p99.9, ``ticks``, ``missed`` and
        ``late_bins`` (see `Histogram.to_mapping`) are of all since the start, so that the figures
        of any stretch are the difference of two summaries.
        """
        late = self._before.plus(self._now)
        largest = max(self._max_before, self._max_now)
        return {
            "late_p50_ms": min(late.percentile(0.5), largest) / 1e6,
            "late_p99_ms": min(late.percentile(0.99), largest) / 1e6,
            "late_max_ms": largest / 1e6,
            "late_p999_ms": self._all.percentile(0.999) / 1e6,
            "ticks": self.ticks,
            "missed": self.missed,
            "late_bins": self._all.to_mapping(),
        }


def now_ns() -> int:
    """The one clock of all processes: CLOCK_MONOTONIC [ns]."""
    return time.monotonic_ns()
