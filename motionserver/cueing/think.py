"""Think: one planner period as a function, from stimulus and accepted plan to a proposal."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from motionserver.core.axes import Array
from motionserver.core.limits import Machine
from motionserver.core.plan import Plan
from motionserver.core.safety.verify import PLANNER_MARGINS, judge
from motionserver.core.state import Stimulus
from motionserver.cueing.base import Cueing, Report
from motionserver.cueing.governor import Proposal, govern
from motionserver.cueing.registry import make_cueing
from motionserver.cueing.tuning import Tuning, blend

RAMP: Final = 1.0
"""Time over which a changed tuning comes into force [s]."""
RAMP_STEPS: Final = 10


@dataclass(frozen=True, slots=True)
class Thought:
    """What came of one period.

    Attributes:
        proposal: The plan to propose; None when the algorithm had no candidate.
        report: What the algorithm tells.
        trouble: Why there is no candidate, for people; empty when there is one.
    """

    proposal: Proposal | None
    report: Report
    trouble: str = ""


class Thinker:
    """The driving algorithm with its tuning, behind the governor."""

    def __init__(
        self,
        machine: Machine,
        tuning: Tuning,
        period: float,
        homes: Array,
        cueing: Cueing | None = None,
    ) -> None:
        self.machine = machine
        self.tuning = tuning
        self.period = period
        self.cueing: Cueing = cueing or make_cueing(machine, tuning, period)
        self._homes = homes
        self._from = tuning
        self._target = tuning
        self._share = 1.0

    def retune(self, target: Tuning, warm: Cueing | None = None) -> None:
        """Go to another tuning within `RAMP` seconds; another algorithm takes over at once.

        Whatever takes over continues the accepted plan, so the platform notices nothing but that
        it is cued in another way.

        Args:
            target: Where to go.
            warm: The algorithm that ``target`` names, with all it has learnt beside the driving
                one; a fresh one is made if None.

        Raises:
            ValueError: The algorithm cannot be made; then nothing has changed.
        """
        if target.algorithm != self.tuning.algorithm:
            now = blend(self.tuning, target, 0.0)
            if warm is None:
                self.cueing = make_cueing(self.machine, now, self.period)
            else:
                warm.retune(now)
                self.cueing = warm
            self.tuning = now
        self._from, self._target, self._share = self.tuning, target, 0.0

    def think(
        self, parent: Plan, before: Plan | None, takeover: float, stimulus: Stimulus, plan_id: int
    ) -> Thought:
        """Plan one period.

        Args:
            parent: The accepted plan.
            before: The plan it took over from, if known.
            takeover: Hand-over in the parent's own time [s].
            stimulus: What should be felt.
            plan_id: Number for the proposal.

        Returns:
            The proposal, or why there is none. A wrong algorithm is contained here: whatever it
            raises becomes "no plan", and the accepted one plays on.
        """
        self._ramp()
        start = parent.state(takeover)

        try:
            candidate = self.cueing.propose(start, parent, takeover, stimulus)
            report = self.cueing.report()
        except Exception as error:
            self.cueing = make_cueing(self.machine, self.tuning, self.period)
            return Thought(None, self._no_report(), f"{type(error).__name__}: {error}")
        if candidate is None:
            return Thought(None, report, report.solver_status)
        if not np.isfinite(candidate.pose).all():
            return Thought(None, report, "the candidate is not finite")
        proposal = govern(
            candidate,
            parent,
            takeover,
            plan_id,
            lambda plan: judge(self.machine, plan, parent, before, PLANNER_MARGINS, self._homes),
        )
        self.cueing.adopt(proposal.plan, proposal.kappa)
        return Thought(proposal, report)

    def _ramp(self) -> None:
        if self._share >= 1.0:
            return
        before = int(self._share * RAMP_STEPS)
        self._share = min(1.0, self._share + self.period / RAMP)
        if int(self._share * RAMP_STEPS) == before and self._share < 1.0:
            return
        tuning = (
            self._target if self._share >= 1.0 else blend(self._from, self._target, self._share)
        )
        self.cueing.retune(tuning)
        self.tuning = tuning

    def _no_report(self) -> Report:
        return Report(self.tuning.box, solver_status="raised")
