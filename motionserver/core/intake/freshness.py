"""Is the source alive? Judged by arrival in our own clock, never by whether values change."""

from __future__ import annotations

import itertools
from collections import deque
from typing import Final

LEAST_HZ: Final = 5.0
"""Packets per second below which nothing can be driven [Hz]: 300 ms is the longest patience."""
MS: Final = 1_000_000
SECOND_NS: Final = 1_000_000_000
_JITTER: Final = 1.1
"""So much longer than at the least rate a usual gap may be [-]."""
_SLOW_GAPS: Final = 8
"""Gaps in which a slow source is recognised."""


def stale_after_ns(interval_ns: int) -> int:
    """Age beyond which a source of this interval is stale [ns]."""
    return max(50 * MS, 3 * interval_ns)


class Freshness:
    """Arrival statistics of one source.

    Stale = newest packet older than max(50 ms, 3 T), with T the median interval over the last
    second, clipped to 5..100 ms, and no shorter than the time between two looks: packets that are
    read together seem to have come together.
    """

    def __init__(self, look_ns: int = 0) -> None:
        """Begin without an arrival; somebody looks every ``look_ns`` [ns]."""
        self._shortest = max(5 * MS, look_ns)
        self._arrivals: deque[int] = deque(maxlen=1024)
        self._gaps: deque[int] = deque(maxlen=_SLOW_GAPS)

    @property
    def is_too_slow(self) -> bool:
        """True if the source sends steadily, and too rarely to drive anything."""
        return len(self._gaps) >= 3 and LEAST_HZ * self.usual_gap() > _JITTER

    def usual_gap(self) -> float:
        """Median time between the last few packets, however long ago they came [s]; at least 1 us.

        Of an outage in a quick stream nothing is seen here.
        """
        gaps = sorted(self._gaps)
        return max(1e-6, gaps[len(gaps) // 2] / SECOND_NS if gaps else 0.0)

    @property
    def newest_ns(self) -> int | None:
        """Arrival of the newest packet [ns]; None before the first."""
        return self._arrivals[-1] if self._arrivals else None

    def arrived(self, now_ns: int) -> None:
        """Note a packet that was believed."""
        if self._arrivals:
            self._gaps.append(now_ns - self._arrivals[-1])
        self._arrivals.append(now_ns)
        while now_ns - self._arrivals[0] > SECOND_NS:
            self._arrivals.popleft()

    def interval_ns(self) -> int:
        """Median interval T of the last second, clipped as told above [ns]."""
        if len(self._arrivals) < 3:
            return 100 * MS
        times = list(self._arrivals)
        gaps = sorted(b - a for a, b in itertools.pairwise(times))
        return min(max(gaps[len(gaps) // 2], self._shortest), 100 * MS)

    def stale_after_ns(self) -> int:
        """Age beyond which the source is stale [ns]."""
        return stale_after_ns(self.interval_ns())

    def age_ns(self, now_ns: int) -> int | None:
        """Age of the newest packet [ns]; None before the first."""
        return None if not self._arrivals else now_ns - self._arrivals[-1]

    def is_stale(self, now_ns: int) -> bool:
        """True if nothing came for too long, or ever."""
        age = self.age_ns(now_ns)
        return age is None or age > self.stale_after_ns()

    def rate_hz(self) -> float:
        """Packets believed per second [Hz]."""
        times = self._arrivals
        if len(times) < 2 or times[-1] == times[0]:
            return 0.0
        return (len(times) - 1) * SECOND_NS / (times[-1] - times[0])
