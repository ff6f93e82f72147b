"""What is left of a period, and what may be begun in it."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from typing import Final

GUESS_NS: Final = 4_000_000
"""How long something takes that has not been measured yet [ns]."""
KEPT: Final = 100
"""How many of the newest measurements count."""
CAREFUL: Final = 0.95
"""Percentile that is expected: on the careful side, but not the one stall in a hundred."""
PATIENCE_NS: Final = 20_000_000_000
"""How long something that took too long is left alone before it is tried again [ns]."""
LONGEST_NS: Final = 640_000_000_000
"""Longest such wait: it doubles with every vain trial [ns]."""


def expected_ns(newest: Iterable[int], guess_ns: int) -> int:
    """How long something takes, on the careful side, or the guess if nothing is measured [ns]."""
    times = sorted(newest)
    return times[int(CAREFUL * (len(times) - 1))] if times else guess_ns


class Cost:
    """How long a thing takes, and whether it may begin now.

    Its 95th percentile decides. A thing that does not fit is never measured again, and the machine
    may only have been busy for a while: so after a time it is tried once, and left alone for twice
    as long if that was too slow again.
    """

    def __init__(self) -> None:
        self._times: deque[int] = deque(maxlen=KEPT)
        self._patience = PATIENCE_NS
        self._last_ns: int | None = None

    @property
    def expected_ns(self) -> int:
        """95th percentile of what was measured [ns]."""
        return expected_ns(self._times, GUESS_NS)

    def fits(self, now_ns: int, left_ns: int) -> bool:
        """Whether it may begin with ``left_ns`` [ns] to go."""
        if self.expected_ns <= left_ns:
            return True
        if self._last_ns is None:
            self._last_ns = now_ns
        if now_ns - self._last_ns < self._patience or left_ns <= 0:
            return False
        self._patience = min(2 * self._patience, LONGEST_NS)
        self._times.clear()
        return True

    def took(self, now_ns: int, spent_ns: int) -> None:
        """Note one run that ended now."""
        self._times.append(spent_ns)
        self._last_ns = now_ns
        if len(self._times) == KEPT:
            self._patience = PATIENCE_NS
