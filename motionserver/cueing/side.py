"""An engine that thinks beside the driving one, on a platform that exists only in its plans."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from itertools import count

import numpy as np

from motionserver.core.axes import Array
from motionserver.core.limits import Machine
from motionserver.core.plan import Plan, rest_at
from motionserver.core.state import Stimulus
from motionserver.cueing.base import Cueing
from motionserver.cueing.scores import Scores
from motionserver.cueing.think import Thinker
from motionserver.cueing.tuning import Tuning

_numbers = count(1)
"""Plans of all side engines: small numbers, so that none is taken for one of the platform's."""


class SideEngine:
    """A thinker with a virtual playback of its own.

    It hears the stimulus that the driving engine hears and thinks with the same code: governor,
    the planner's own verification (`core.safety.verify.judge`), adoption. What passes is played
    virtually, in plan time: one period of the driving engine is one period here, however long
    thinking took. A period that is skipped passes on the plan it has, which ends at rest. Nothing
    of it ever leaves the planner: it makes no accepted plan and no setpoint.

    Args:
        machine: Geometry and hard limits.
        tuning: Tunables of the driving engine; the algorithm of them is replaced.
        algorithm: What thinks here.
        period: Planner period [s].
        homes: Poses (H, 6) that must be reachable straight from a rest pose.
        cueing: A warm algorithm of that name to go on with; None for a fresh one.
        scores: Its figures until now; None to begin anew.

    Attributes:
        algorithm: Its name.
        scores: Its figures.
        counters: periods, skipped, raised.
        trouble: Why there was no candidate the last time; empty when there was one.

    Raises:
        ValueError: There is no such algorithm, or it cannot be made with these tunables.
    """

    def __init__(
        self,
        machine: Machine,
        tuning: Tuning,
        algorithm: str,
        period: float,
        homes: Array,
        cueing: Cueing | None = None,
        scores: Scores | None = None,
    ) -> None:
        self.algorithm = algorithm
        self.scores = Scores(machine, period) if scores is None else scores
        self.counters: Counter[str] = Counter()
        self.trouble = ""
        self._period = period
        self._thinker = Thinker(
            machine, replace(tuning, algorithm=algorithm), period, homes, cueing
        )
        self.stand()

    @property
    def cueing(self) -> Cueing:
        """The algorithm with all it has learnt."""
        return self._thinker.cueing

    def stand(self) -> None:
        """Stand at neutral, as the platform does after raising; what was learnt stays."""
        self._continue(rest_at(np.zeros(6), next(_numbers)), 0.0)

    def start_from(self, plan: Plan, clock: float) -> None:
        """Go on where the platform is.

        Args:
            plan: The accepted plan.
            clock: Its own time at the next hand-over [s].
        """
        self._continue(replace(plan, plan_id=next(_numbers)), max(0.0, clock - self._period))

    def settle(self) -> None:
        """Bring a changed tuning into force at once: nothing is cued."""
        self._thinker.settle()

    def _continue(self, plan: Plan, clock: float) -> None:
        self._plan, self._clock = plan, clock
        self._before: Plan | None = None
        self._next: Plan | None = None
        self.scores.pause()

    def retune(self, tuning: Tuning) -> None:
        """Take the driving engine's tunables, all but the algorithm, as softly as it does."""
        try:
            self._thinker.retune(replace(tuning, algorithm=self.algorithm))
        except Exception as error:
            self._stumbled(error)

    def think(self, stimulus: Stimulus, clock: Callable[[], float]) -> None:
        """Pass one period and plan the next; contains whatever the algorithm does.

        Args:
            stimulus: What should be felt; with `STILL` it washes out.
            clock: Tells the time, to measure how long this takes [s].
        """
        begun = clock()
        takeover = self._pass(stimulus)
        kappa = None
        try:
            thought = self._thinker.think(
                self._plan, self._before, takeover, stimulus, next(_numbers)
            )
        except Exception as error:
            self._stumbled(error)
        else:
            self.trouble = thought.trouble
            self.counters["raised"] += thought.report.solver_status == "raised"
            if thought.proposal is not None:
                self._next, kappa = thought.proposal.plan, thought.proposal.kappa
        self.scores.thought(kappa, clock() - begun)

    def skip(self, stimulus: Stimulus) -> None:
        """Pass one period without thinking: the plan it has plays on."""
        self._pass(stimulus)
        self.counters["skipped"] += 1

    def _pass(self, stimulus: Stimulus) -> float:
        """Let one period go by; the next hand-over in the time of the plan then in force [s]."""
        if self._next is not None:
            self._before, self._plan, self._clock = self._plan, self._next, 0.0
            self._next = None
        else:
            self._clock += self._period
        self.counters["periods"] += 1
        takeover = self._clock + self._period
        self.scores.heard(self._plan, takeover, stimulus)
        return takeover

    def _stumbled(self, error: Exception) -> None:
        self.counters["raised"] += 1
        self.trouble = f"{type(error).__name__}: {error}"
