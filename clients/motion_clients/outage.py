"""Was the server away? Told from what the system reports of a port that nobody listens at."""

from __future__ import annotations

from typing import Final

AWAY_NS: Final = 500_000_000
"""Time without a listener after which the server counts as started anew [ns]."""
GAP_NS: Final = 2_000_000_000
"""Time without a refusal after which the next one begins another outage [ns]."""


class Outage:
    """Refusals of one outage, and whether it was told yet."""

    def __init__(self) -> None:
        self._first_ns = self._last_ns = -GAP_NS - 1
        self._is_told = False

    def refused(self, now_ns: int) -> bool:
        """Take note of a refusal.

        Args:
            now_ns: Monotonic clock [ns].

        Returns:
            True once in an outage: when it has lasted long enough.
        """
        if now_ns - self._last_ns > GAP_NS:
            self._first_ns, self._is_told = now_ns, False
        self._last_ns = now_ns
        if self._is_told or now_ns - self._first_ns < AWAY_NS:
            return False
        self._is_told = True
        return True
