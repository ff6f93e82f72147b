"""The shape of a plan: knots in order, finite, at rest at the end, continuing its parent."""

from __future__ import annotations

from typing import Final

import numpy as np

from motionserver.core.plan import FIRST_STEP, KNOT_STEP, MAX_KNOTS, Plan
from motionserver.core.safety.verdict import Reason, Rejection

_POSE_TOLERANCE: Final = 1e-7
_VELOCITY_TOLERANCE: Final = 1e-6
_ACCELERATION_TOLERANCE: Final = 1e-4
_REST_TOLERANCE: Final = 1e-9
_ROUNDING: Final = 1e-9
_WILD: Final = 1e4


def well_formed(plan: Plan, longest: float) -> Rejection | None:
    """Shape, order of knots, finiteness, and rest at the end."""
    count = len(plan.times)
    shape = (count, 6)
    tables = (plan.pose, plan.velocity, plan.acceleration)
    if not 2 <= count <= MAX_KNOTS:
        return Rejection(Reason.MALFORMED, value=count, allowed=MAX_KNOTS)
    if plan.times.shape != (count,) or any(table.shape != shape for table in tables):
        return Rejection(Reason.MALFORMED)
    if not (
        np.isfinite(plan.takeover) and all(np.isfinite(t).all() for t in (plan.times, *tables))
    ):
        return Rejection(Reason.NOT_FINITE)
    if plan.times[0] != 0.0:
        return Rejection(Reason.MALFORMED, when=float(plan.times[0]))
    last = float(np.max(plan.times))
    if last > longest:
        return Rejection(Reason.MALFORMED, value=last, allowed=longest)
    # knots between two samples of the grid could hide any motion there
    steps = np.diff(plan.times)
    least = np.where(np.arange(count - 1) == 0, FIRST_STEP, KNOT_STEP) - _ROUNDING
    if (steps < least).any():
        knot = int(np.argmax(steps < least))
        return Rejection(
            Reason.MALFORMED, float(plan.times[knot]), None, float(steps[knot]), float(least[knot])
        )
    # wild numbers could overflow in the kinematics; no platform of ours is a hundred metres wide
    if max(float(np.max(np.abs(t))) for t in tables) > _WILD:
        return Rejection(Reason.NOT_FINITE, value=_WILD)
    speed = float(max(np.max(np.abs(plan.velocity[-1])), np.max(np.abs(plan.acceleration[-1]))))
    if speed > _REST_TOLERANCE:
        return Rejection(Reason.NOT_AT_REST, when=plan.duration, value=speed, allowed=0.0)
    return None


def continues(plan: Plan, parent: Plan) -> Rejection | None:
    """Position, velocity and acceleration at the hand-over are the parent's."""
    there = parent.state(plan.takeover)
    for found, wanted, tolerance in (
        (plan.pose[0], there.pose, _POSE_TOLERANCE),
        (plan.velocity[0], there.velocity, _VELOCITY_TOLERANCE),
        (plan.acceleration[0], there.acceleration, _ACCELERATION_TOLERANCE),
    ):
        gap = float(np.max(np.abs(found - wanted)))
        if gap > tolerance:
            return Rejection(Reason.DISCONTINUOUS, when=0.0, value=gap, allowed=tolerance)
    return None
