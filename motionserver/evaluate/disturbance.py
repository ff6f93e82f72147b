"""Trouble on purpose: stalled planners, failed solves, answers that are not numbers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil
from typing import Final

import numpy as np

from motionserver.core.axes import Array, frozen
from motionserver.core.plan import Plan
from motionserver.core.state import PlatformState, Stimulus
from motionserver.cueing.base import Candidate, Cueing, Report
from motionserver.cueing.think import Thinker
from motionserver.cueing.tuning import Tuning

STALLED: Final = "stalled on purpose"
FAILED: Final = "failed on purpose"
_TABLES: Final = ("pose", "velocity", "acceleration")


@dataclass(frozen=True, slots=True)
class Disturbance:
    """How a planner is troubled; the same seed troubles the same periods.

    Attributes:
        seed: Of the dice.
        stalled: Share of plans that come too late: dropped, and the planner misses the periods
            that pass meanwhile [-].
        stall: How late they come [s].
        failed: Share of plans that are not found [-].
        nan: Share of plans with a number in them that is none [-].
    """

    seed: int = 0
    stalled: float = 0.02
    stall: float = 0.05
    failed: float = 0.05
    nan: float = 0.01

    def __post_init__(self) -> None:
        shares = (self.stalled, self.failed, self.nan)
        if min(shares) < 0.0 or not sum(shares) <= 1.0 or not self.stall > 0.0:
            raise ValueError(
                f"disturbance: shares {shares} must be 0 or more and sum up to at most 1, the "
                f"stall of {self.stall:g} s must be above 0; change them"
            )


class Trouble:
    """Puts itself between a thinker and its algorithm.

    Args:
        disturbance: What happens.
        period: Planner period [s].
    """

    def __init__(self, disturbance: Disturbance, period: float) -> None:
        self._disturbance = disturbance
        self._dice = np.random.default_rng(disturbance.seed)
        # late by the stall: the periods that begin meanwhile are missed
        self._missed = max(0, ceil(disturbance.stall / period - 1e-9) - 1)
        self._left = 0

    def ride(self, thinker: Thinker) -> None:
        """Trouble this thinker's algorithm; again after it was replaced by a new one."""
        if not isinstance(thinker.cueing, _Troubled):
            thinker.cueing = _Troubled(thinker.cueing, self)

    def propose(
        self,
        cueing: Cueing,
        start: PlatformState,
        parent: Plan,
        takeover: float,
        stimulus: Stimulus,
    ) -> tuple[Candidate | None, str]:
        """What comes of one period: a candidate, or a word for why there is none."""
        if self._left > 0:
            self._left -= 1
            return None, STALLED
        # one throw decides, so that other shares move no other period
        throw, where = self._dice.random(2)
        candidate = cueing.propose(start, parent, takeover, stimulus)
        limit = self._disturbance.stalled
        if throw < limit:
            self._left = self._missed
            return None, STALLED
        limit += self._disturbance.failed
        if throw < limit:
            return None, FAILED
        if throw < limit + self._disturbance.nan and candidate is not None:
            return _spoilt(candidate, where), ""
        return candidate, ""


class _Troubled:
    """An algorithm that is sometimes late, sometimes fails, sometimes answers nonsense."""

    def __init__(self, inner: Cueing, trouble: Trouble) -> None:
        self.name = inner.name
        self._inner, self._trouble, self._word = inner, trouble, ""

    @property
    def disturbance(self) -> Array:
        return self._inner.disturbance

    @disturbance.setter
    def disturbance(self, value: Array) -> None:
        self._inner.disturbance = value

    def propose(
        self, start: PlatformState, parent: Plan, takeover: float, stimulus: Stimulus
    ) -> Candidate | None:
        candidate, self._word = self._trouble.propose(
            self._inner, start, parent, takeover, stimulus
        )
        return candidate

    def adopt(self, plan: Plan, kappa: float) -> None:
        self._inner.adopt(plan, kappa)

    def retune(self, tuning: Tuning) -> None:
        self._inner.retune(tuning)

    def report(self) -> Report:
        report = self._inner.report()
        return replace(report, solver_status=self._word) if self._word else report


def _spoilt(candidate: Candidate, where: float) -> Candidate:
    """The candidate with one number of one table that is none."""
    tables = [candidate.pose, candidate.velocity, candidate.acceleration]
    place = int(where * sum(table.size for table in tables))
    which, inside = divmod(place, candidate.pose.size)
    table = tables[which].copy()
    table.flat[inside] = np.nan
    return replace(candidate, **{_TABLES[which]: frozen(table)})
