"""How much of what the owner sends can be believed: a sender with a fault is not driven on."""

from __future__ import annotations

from collections import deque
from typing import Final

from motionserver.core.intake.freshness import SECOND_NS

MOST_BAD: Final = 0.1
"""Share of bad packets within a second beyond which the rest is not believed either."""
FEWEST: Final = 10
"""Packets within the second below which no share is judged."""


class Spoilage:
    """The share of bad packets among those of the last second."""

    def __init__(self) -> None:
        self._heard: deque[tuple[int, bool]] = deque(maxlen=4096)
        self._bad = 0

    def heard(self, now_ns: int, is_bad: bool) -> None:
        """Note a packet."""
        if len(self._heard) == self._heard.maxlen:
            self._forget()
        self._heard.append((now_ns, is_bad))
        self._bad += is_bad

    def share(self, now_ns: int) -> float:
        """Share of bad packets in the last second, 0..1; 0 while there are too few to tell."""
        self._forget_before(now_ns - SECOND_NS)
        count = len(self._heard)
        return self._bad / count if count >= FEWEST else 0.0

    def is_spoilt(self, now_ns: int) -> bool:
        """True if more is bad than may be."""
        return self.share(now_ns) > MOST_BAD

    def _forget_before(self, instant_ns: int) -> None:
        while self._heard and self._heard[0][0] < instant_ns:
            self._forget()

    def _forget(self) -> None:
        _, was_bad = self._heard.popleft()
        self._bad -= was_bad
