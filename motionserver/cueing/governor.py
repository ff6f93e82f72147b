"""One governor for every algorithm: blend candidate and accepted plan until it verifies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from motionserver.core.axes import frozen
from motionserver.core.plan import FIRST_STEP, KNOT_STEP, Plan
from motionserver.core.safety.verdict import Rejection
from motionserver.cueing.base import Candidate

KAPPAS: Final = tuple(0.5**halving for halving in range(8))


@dataclass(frozen=True, slots=True)
class Proposal:
    """What the governor let through.

    Attributes:
        plan: The plan to propose.
        kappa: Share of the candidate in it; 0 is the accepted plan going on.
        refusals: Why the larger shares were refused, in order.
    """

    plan: Plan
    kappa: float
    refusals: tuple[Rejection, ...]


def govern(
    candidate: Candidate | None,
    parent: Plan,
    takeover: float,
    plan_id: int,
    check: Callable[[Plan], Rejection | None],
) -> Proposal:
    """Find the largest share of the candidate that verifies.

    Plan(kappa) = rest of the accepted plan + kappa (candidate - rest of the accepted plan). Both
    agree at the hand-over and both end at rest, so the blend does too. kappa = 0 always exists: it
    is the accepted plan itself, from the hand-over on.

    Args:
        candidate: The algorithm's trajectory from the hand-over; None when it has none.
        parent: The accepted plan.
        takeover: Hand-over in the parent's own time [s].
        plan_id: Number for the proposal.
        check: The planner's own verification; None means it passes.

    Returns:
        The proposal and why it is not more.
    """
    refusals: list[Rejection] = []
    if candidate is not None:
        times = candidate.times
        # the accepted plan must be at rest where the candidate is, or the blend would cut it off
        end = parent.duration - takeover
        if end > times[-1] + 1e-9:
            times = np.append(times, max(end, times[-1] + KNOT_STEP))
        pose, velocity, acceleration = parent.evaluate(takeover + times)
        aim = (
            _held(candidate.pose, len(times)),
            _padded(candidate.velocity, len(times)),
            _padded(candidate.acceleration, len(times)),
        )
        knots = frozen(times)
        for kappa in KAPPAS:
            plan = Plan(
                plan_id,
                parent.plan_id,
                takeover,
                knots,
                frozen(pose + kappa * (aim[0] - pose)),
                frozen(velocity + kappa * (aim[1] - velocity)),
                frozen(acceleration + kappa * (aim[2] - acceleration)),
            )
            refusal = check(plan)
            if refusal is None:
                return Proposal(plan, kappa, tuple(refusals))
            refusals.append(refusal)
    return Proposal(remainder(parent, takeover, plan_id), 0.0, tuple(refusals))


def remainder(parent: Plan, takeover: float, plan_id: int) -> Plan:
    """The accepted plan from ``takeover`` [s] on, as a plan of its own: the same quintics."""
    later = parent.times[parent.times > takeover + FIRST_STEP]
    if len(later) == 0:
        later = np.array([takeover + 0.01])
    instants = np.concatenate(([takeover], later))
    pose, velocity, acceleration = parent.evaluate(instants)
    velocity[-1] = 0.0
    acceleration[-1] = 0.0
    return Plan(
        plan_id,
        parent.plan_id,
        takeover,
        frozen(instants - takeover),
        frozen(pose),
        frozen(velocity),
        frozen(acceleration),
    )


def _held(table: np.ndarray, count: int) -> np.ndarray:
    return np.concatenate((table, np.repeat(table[-1:], count - len(table), axis=0)))


def _padded(table: np.ndarray, count: int) -> np.ndarray:
    return np.concatenate((table, np.zeros((count - len(table), 6))))
