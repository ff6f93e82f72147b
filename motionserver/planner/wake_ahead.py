"""How long before its send slot the planner wakes: as long as a plan takes, and a little more."""

from __future__ import annotations

from collections import deque
from typing import Final

WINDOW: Final = 300
"""How many of the newest plans count."""
LEAST: Final = 20
"""With fewer the first guess holds."""
CAREFUL: Final = 0.99
"""Percentile of the time from the planned wake-up to the proposal that is allowed for."""
MARGIN_NS: Final = 500_000
"""Allowed for besides: what a plan takes more than those before it [ns]."""
SHORTEST_NS: Final = 1_000_000
"""A plan begun closer to its slot would miss it at the first disturbance [ns]."""
STEP_NS: Final = 500_000
"""Most by which it changes from one wake-up to the next [ns]."""
PERIODS: Final = 1.5
"""Longest time ahead, in planner periods: what takes longer comes in a later slot."""


class WakeAhead:
    """Follows the measured time of a plan, down as well as up.

    Args:
        guess_ns: What holds until enough is measured [ns].
        period_ns: Time between two plans [ns].
        check_ns: How long the guard takes for its verdict, beyond one tick [ns].

    Attributes:
        ahead_ns: How long before its send slot the next plan is begun [ns].
    """

    def __init__(self, guess_ns: int, period_ns: int, check_ns: int) -> None:
        self.ahead_ns = guess_ns
        self._longest_ns = round(PERIODS * period_ns)
        self._check_ns = check_ns
        self._times: deque[int] = deque(maxlen=WINDOW)

    def took(self, spent_ns: int) -> None:
        """Note one plan: from when the planner was to wake until it proposed."""
        self._times.append(spent_ns)
        if len(self._times) < LEAST:
            return
        usual = sorted(self._times)[int(CAREFUL * (len(self._times) - 1))]
        goal = usual + MARGIN_NS + self._check_ns
        goal = min(max(goal, SHORTEST_NS + self._check_ns), self._longest_ns)
        self.ahead_ns += min(max(goal - self.ahead_ns, -STEP_NS), STEP_NS)
