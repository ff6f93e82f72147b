"""A check of proposals that takes several ticks, for a guard whose tick is shorter than a check."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil
from typing import Final

from motionserver.core.axes import Array
from motionserver.core.limits import Machine
from motionserver.core.motion.player import MOST_PENDING, Playback
from motionserver.core.plan import Plan
from motionserver.core.safety.accept import accept_in_slices, untimely
from motionserver.core.safety.slices import Slices
from motionserver.core.safety.states import CUED, State
from motionserver.core.safety.verdict import AcceptedPlan, Reason, Rejection

Verdict = AcceptedPlan | Rejection

BLOCK: Final = 512
"""Samples per slice: a tenth of a millisecond."""
SHORT: Final = 0.003
"""A guard with a tick shorter than this checks in slices [s]: a whole check takes up to 1 ms."""
_PER_SLICE: Final = 0.0005
_USUAL: Final = 8
"""Slices of a check, but for one whose jerk is looked at twice."""


def slices_per_tick(tick: float) -> int:
    """Slices of a check that a tick of ``tick`` [s] has room for; 0 = the whole check."""
    return 0 if tick >= SHORT else max(1, int(tick / _PER_SLICE + 1e-6))


def time_of_check(tick: float) -> float:
    """From a proposal's arrival to its verdict where ticks of ``tick`` [s] check in slices [s]."""
    slices = slices_per_tick(tick)
    return (ceil(_USUAL / slices) + 1) * tick if slices else 0.0


def may_follow(state: State, playback: Playback | None) -> Rejection | None:
    """Whether any proposal could be taken now."""
    if state not in CUED or playback is None:
        return Rejection(Reason.NOT_CUEING)
    return Rejection(Reason.TOO_EARLY) if len(playback.pending) >= MOST_PENDING else None


@dataclass(frozen=True, slots=True)
class _UnderWay:
    plan: Plan
    parent: AcceptedPlan
    slices: Slices[Verdict]


class PatientCheck:
    """Checks one proposal at a time, some slices per tick; of those that wait the newest stays.

    Args:
        machine: Geometry and hard limits.
        homes: Poses (H, 6) that must be reachable straight from a plan's rest pose.
        slices: Most slices per tick.
    """

    def __init__(self, machine: Machine, homes: Array, slices: int) -> None:
        self._machine, self._homes, self._slices = machine, homes, slices
        self._waiting: Plan | None = None
        self._check: _UnderWay | None = None

    @property
    def is_busy(self) -> bool:
        """True while a proposal is being checked."""
        return self._check is not None

    def offer(self, proposal: Plan) -> bool:
        """Take a proposal; it waits for the one under way. True if it replaced one that waited."""
        has_overtaken = self._waiting is not None
        self._waiting = proposal
        return has_overtaken

    def tick(self, state: State, playback: Playback | None) -> tuple[Plan, Verdict] | None:
        """Do the slices of one tick.

        Args:
            state: Motion state now.
            playback: What is played now.

        Returns:
            A proposal and its verdict, as of now; None while none is ready.
        """
        refusal = may_follow(state, playback)
        # forgotten unless it rests: a check that raised is over
        check, self._check = self._check, None
        if check is None:
            if self._waiting is None:
                return None
            plan, self._waiting = self._waiting, None
            if refusal is not None:
                return plan, refusal
            assert playback is not None
            check = self._begun(plan, playback)
        verdict = refusal or self._now(check, playback)
        if verdict is None:
            self._check = check
            return None
        return check.plan, verdict

    def _begun(self, plan: Plan, playback: Playback) -> _UnderWay:
        parent, clock = playback.newest, playback.newest_clock
        slices = accept_in_slices(self._machine, plan, parent, clock, self._homes, BLOCK)
        return _UnderWay(plan, parent, slices)

    def _now(self, check: _UnderWay, playback: Playback | None) -> Verdict | None:
        assert playback is not None
        # by itself, not by its number: a guard that parks plays plans of its own
        if playback.newest is not check.parent:
            return Rejection(Reason.WRONG_PARENT)
        try:
            for _ in range(self._slices):
                next(check.slices)
        except StopIteration as done:
            verdict: Verdict = done.value
            if isinstance(verdict, Rejection):
                return verdict
            return untimely(verdict.plan, playback.newest, playback.newest_clock) or verdict
        return None
