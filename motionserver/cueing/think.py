"""Think: one planner period as a function, from stimulus and accepted plan to a proposal."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from motionserver.core.axes import Array
from motionserver.core.limits import Machine
from motionserver.core.plan import Plan
from motionserver.core.safety.verify import PLANNER_MARGINS, judge
from motionserver.core.state import Stimulus
from motionserver.cueing.base import Cueing, ReadsBack, Report
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


def prepare(machine: Machine, tuning: Tuning, period: float) -> Cueing:
    """Make the algorithm that a `Thinker` drives with, off to the side.

    Raises:
        Exception: It cannot be made: `TunableError` from ours, anything from a plug-in.
    """
    return make_cueing(machine, tuning, period)


class Thinker:
    """The driving algorithm with its tuning, behind the governor.

    Attributes:
        tuning: What the algorithm took last.
        refused: Why a change did not come into force after all; empty otherwise.
    """

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
        self.refused = ""

    @property
    def is_ramping(self) -> bool:
        """Whether a changed tuning is still coming into force."""
        return self._share < 1.0

    @property
    def in_force(self) -> Tuning:
        """The tuning as the algorithm itself has it, where it tells; else what it took last."""
        try:
            told = self.cueing.tuning if isinstance(self.cueing, ReadsBack) else self.tuning
        except Exception:  # a plug-in must not keep the page from being answered
            return self.tuning
        return replace(told, algorithm=self.tuning.algorithm, scale=self.tuning.scale)

    def retune(
        self, target: Tuning, warm: Cueing | None = None, fresh: Cueing | None = None
    ) -> None:
        """Go to another tuning within `RAMP` seconds; another algorithm takes over at once.

        Whatever takes over continues the accepted plan, so the platform notices nothing but that
        it is cued in another way.

        Args:
            target: Where to go.
            warm: The algorithm that ``target`` names, with all it has learnt beside the driving
                one.
            fresh: The same as `prepare` made it; taken if there is none that is warm.

        Raises:
            Exception: The algorithm cannot be made; then nothing has changed.
        """
        if target.algorithm != self.tuning.algorithm:
            now = blend(self.tuning, target, 0.0)
            self.cueing = self._taking_over(now, warm, fresh)
            self.tuning = now
        self._from, self._target, self._share = self.tuning, target, 0.0
        self.refused = ""

    def _taking_over(self, now: Tuning, warm: Cueing | None, fresh: Cueing | None) -> Cueing:
        for ready in (warm, fresh):
            if ready is None:
                continue
            try:
                ready.retune(now)
            except Exception:  # then the next best
                continue
            return ready
        return make_cueing(self.machine, now, self.period)

    def settle(self) -> None:
        """Bring a changed tuning into force at once: nothing is cued that could notice."""
        if self._share < 1.0:
            self._share = 1.0
            self._take(self._target)

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
        self.ramp()
        start = parent.state(takeover)

        try:
            candidate = self.cueing.propose(start, parent, takeover, stimulus)
            report = self.cueing.report()
        except Exception as error:
            self._renew()
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

    def ramp(self) -> None:
        """Let a changed tuning come into force by one period; never raises."""
        if self._share >= 1.0:
            return
        before = int(self._share * RAMP_STEPS)
        self._share = min(1.0, self._share + self.period / RAMP)
        if int(self._share * RAMP_STEPS) == before and self._share < 1.0:
            return
        tuning = (
            self._target if self._share >= 1.0 else blend(self._from, self._target, self._share)
        )
        self._take(tuning)

    def _take(self, tuning: Tuning) -> None:
        """Hand a tuning to the algorithm.

        One that does not take it is made anew with it. If that fails as well, the change ends
        here: what was in force stays, `refused` says why, and later changes are free.
        """
        try:
            self.cueing.retune(tuning)
        except Exception as error:
            try:
                self.cueing = make_cueing(self.machine, tuning, self.period)
            except Exception:
                self.refused = f"{type(error).__name__}: {error}"
                self._from = self._target = self.tuning
                self._share = 1.0
                self._renew()
                return
        self.tuning = tuning

    def _renew(self) -> None:
        """Replace an algorithm that raised by a fresh one; keep it where none can be made."""
        with contextlib.suppress(Exception):
            self.cueing = make_cueing(self.machine, self.tuning, self.period)

    def _no_report(self) -> Report:
        return Report(self.tuning.box, solver_status="raised")
