"""The only makers of accepted plans: proposals, rest poses, rest-to-rest moves."""

from __future__ import annotations

from math import isfinite

import numpy as np

from motionserver.core.axes import Array
from motionserver.core.limits import Machine
from motionserver.core.motion.moves import rest_to_rest, straight_way, straight_ways
from motionserver.core.plan import Plan, rest_at
from motionserver.core.safety.shape import continues, well_formed
from motionserver.core.safety.slices import Slices, whole
from motionserver.core.safety.verdict import AcceptedPlan, Reason, Rejection
from motionserver.core.safety.verify import (
    AHEAD,
    CLOSEST,
    GUARD_MARGINS,
    LONGEST_MOVE,
    check_legs,
    check_ways_home,
    judge_in_slices,
)


def accept_proposal(
    machine: Machine, plan: Plan, parent: AcceptedPlan, clock: float, homes: Array
) -> AcceptedPlan | Rejection:
    """Decide about a planner's proposal.

    Args:
        machine: Geometry and hard limits.
        plan: The proposal.
        parent: The newest accepted plan.
        clock: The parent's own time now [s]; negative while it still waits for its instant.
        homes: Poses (H, 6) that must be reachable straight from its rest pose.

    Returns:
        The accepted plan, or why not.
    """
    return whole(accept_in_slices(machine, plan, parent, clock, homes, None))


def accept_in_slices(
    machine: Machine,
    plan: Plan,
    parent: AcceptedPlan,
    clock: float,
    homes: Array,
    block: int | None,
) -> Slices[AcceptedPlan | Rejection]:
    """`accept_proposal`, with rests between its parts and after every ``block`` samples.

    Whoever lets time pass meanwhile must ask `untimely` again before the plan is played.
    """
    rejection = untimely(plan, parent, clock) or (
        yield from judge_in_slices(
            machine, plan, parent.plan, parent.before, GUARD_MARGINS, homes, block
        )
    )
    if rejection is not None:
        return rejection
    return AcceptedPlan(plan, parent.plan, _home_bound(machine, plan.rest_pose, homes))


def untimely(plan: Plan, parent: AcceptedPlan, clock: float) -> Rejection | None:
    """Whether a proposal names another parent, or an instant that has passed or is far.

    Args:
        plan: The proposal.
        parent: The newest accepted plan.
        clock: The parent's own time now [s]; negative while it still waits for its instant.
    """
    if plan.parent_id != parent.plan.plan_id or plan.plan_id == plan.parent_id:
        return Rejection(Reason.WRONG_PARENT)
    if not isfinite(plan.takeover):
        return Rejection(Reason.NOT_FINITE)
    earliest = max(clock, CLOSEST if parent.before is not None else 0.0)
    if not plan.takeover >= earliest:
        return Rejection(Reason.TOO_LATE, None, None, plan.takeover, earliest)
    if plan.takeover - clock > AHEAD:
        return Rejection(Reason.TOO_EARLY, None, None, plan.takeover, clock + AHEAD)
    return None


def accept_rest(
    machine: Machine, pose: Array, plan_id: int, homes: Array, reach: float = 0.0
) -> AcceptedPlan | Rejection:
    """Accept standing at ``pose`` (6,), where the platform is known to be.

    Args:
        machine: Geometry and hard limits.
        pose: Where it stands.
        plan_id: Number of the new plan.
        homes: Poses (H, 6) that must be reachable straight from it.
        reach: How far a leg may be drawn towards neutral to come inside the margins [m]; a
            measured pose may lie a hair outside.

    Returns:
        The accepted plan, or why not.
    """
    verdict = _checked(machine, rest_at(pose, plan_id), None, None, homes)
    legs = straight_way(machine, pose, np.zeros(6)).legs
    furthest = float(np.max(np.abs(legs[0] - legs[-1])))
    for share in (0.005, 0.01, 0.02, 0.05):
        if isinstance(verdict, AcceptedPlan) or share * furthest > reach:
            break
        verdict = _checked(machine, rest_at(pose * (1.0 - share), plan_id), None, None, homes)
    return verdict


def accept_move(
    machine: Machine, parent: AcceptedPlan, takeover: float, goal: Array, plan_id: int, homes: Array
) -> AcceptedPlan | Rejection:
    """Accept the straight move from where ``parent`` rests to ``goal`` (6,), stretched to verify.

    Args:
        machine: Geometry, hard limits, pace.
        parent: The plan that stands still at ``takeover``.
        takeover: Instant in the parent's own time, at or after its end [s].
        goal: Pose to reach.
        plan_id: Number of the new plan.
        homes: Poses (H, 6) that must be reachable straight from the goal.

    Returns:
        The accepted plan, or why not.
    """
    start = parent.plan.rest_pose
    way = straight_way(machine, start, goal)
    duration = way.duration
    plan = rest_to_rest(plan_id, parent.plan.plan_id, takeover, start, goal, duration)
    if takeover < parent.plan.duration:
        return Rejection(Reason.NOT_AT_REST, None, None, takeover, parent.plan.duration)
    return _checked(machine, plan, parent.plan, parent.before, homes)


def accept_again(
    machine: Machine, plan: Plan, before: Plan | None, homes: Array
) -> AcceptedPlan | Rejection:
    """Accept what another guard had accepted: the same rules, but for its instant.

    Args:
        machine: Geometry and hard limits.
        plan: What was accepted: a proposal, a rest or a move.
        before: The plan it took over from; None for a rest.
        homes: Poses (H, 6) that must be reachable straight from its rest pose.

    Returns:
        The accepted plan, or why not.
    """
    if before is not None:
        rejection = (
            well_formed(plan, LONGEST_MOVE)
            or well_formed(before, LONGEST_MOVE)
            or continues(plan, before)
        )
        if rejection is not None:
            return rejection
    return _checked(machine, plan, before, None, homes)


def _checked(
    machine: Machine, plan: Plan, parent: Plan | None, before: Plan | None, homes: Array
) -> AcceptedPlan | Rejection:
    """Accept a plan of the guard's own; ``before`` is what its parent took over from, if known."""
    rejection = (
        well_formed(plan, LONGEST_MOVE)
        or check_legs(machine, plan, parent or plan, before, GUARD_MARGINS)
        or check_ways_home(machine, plan.rest_pose, homes, GUARD_MARGINS)
    )
    if rejection is not None:
        return rejection
    return AcceptedPlan(plan, parent, _home_bound(machine, plan.rest_pose, homes))


def _home_bound(machine: Machine, rest: Array, homes: Array) -> float:
    return max(way.duration for way in straight_ways(machine, rest, homes))
