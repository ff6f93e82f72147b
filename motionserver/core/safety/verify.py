"""The independent check of a plan in leg space, on a fixed grid, before it may be played."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from motionserver.core.axes import Array
from motionserver.core.kinematics.hexapod import (
    conditioning,
    is_conditioned,
    joint_angles,
    leg_directions,
    leg_lengths,
    neutral_conditioning,
)
from motionserver.core.limits import Machine
from motionserver.core.motion.moves import straight_ways
from motionserver.core.plan import MAX_DURATION, Plan
from motionserver.core.safety.shape import continues, well_formed
from motionserver.core.safety.slices import Slices, blocks, whole
from motionserver.core.safety.verdict import Reason, Rejection

GRID: Final = 0.002
"""Spacing of the samples that are checked [s]."""
CLOSEST: Final = 0.003
"""Least time between two hand-overs [s]: the samples before a hand-over lie on one parent."""
AHEAD: Final = 0.5
"""Longest wait of an accepted plan for its instant [s]: nothing may hold off a stop for longer."""
LONGEST_MOVE: Final = 60.0
"""Longest rest-to-rest move [s]."""

_DOUBTFUL: Final = 0.65
_POSTURE_EVERY: Final = 16
_WAY_EVERY: Final = 4


@dataclass(frozen=True, slots=True)
class Margins:
    """What is kept between the checked samples and the limits, for what lies between samples.

    Attributes:
        stroke: Kept from both ends of the stroke [m]; a h^2/8 is 4 um of it.
        share: Share of leg speed and acceleration that may be used [-].
        jerk_share: Share of leg jerk that may be used [-]; jerk changes fastest between samples.
        swing: Kept from the largest joint angle [rad].
        conditioning: Least conditioning as a multiple of the machine's [-].
    """

    stroke: float = 0.0002
    share: float = 0.995
    jerk_share: float = 0.97
    swing: float = 0.001
    conditioning: float = 1.01


GUARD_MARGINS: Final = Margins()
PLANNER_MARGINS: Final = Margins(
    stroke=0.0005, share=0.98, jerk_share=0.94, swing=0.003, conditioning=1.03
)
"""Tighter, so that what remains of an accepted plan passes again on a shifted grid."""


def judge(
    machine: Machine,
    plan: Plan,
    parent: Plan,
    before: Plan | None,
    margins: Margins = GUARD_MARGINS,
    homes: Array | None = None,
) -> Rejection | None:
    """Check everything about a plan but its timeliness.

    Args:
        machine: Geometry and hard limits.
        plan: The plan to judge.
        parent: The plan it takes over from.
        before: The plan the parent took over from, if known.
        margins: How far inside the limits it must stay.
        homes: Poses (H, 6) to which a straight way from the rest pose must exist; the machine's
            parked pose if None.

    Returns:
        None if it may be played, else the first rule it breaks.
    """
    goals = machine.parked_pose[None] if homes is None else homes
    return whole(judge_in_slices(machine, plan, parent, before, margins, goals, None))


def judge_in_slices(
    machine: Machine,
    plan: Plan,
    parent: Plan,
    before: Plan | None,
    margins: Margins,
    homes: Array,
    block: int | None,
) -> Slices[Rejection | None]:
    """`judge`, with rests between its parts and after every ``block`` samples; None is no rest."""
    rejection = well_formed(plan, MAX_DURATION) or continues(plan, parent)
    if rejection is not None:
        return rejection
    yield
    rejection = yield from check_legs_in_slices(machine, plan, parent, before, margins, block)
    if rejection is not None:
        return rejection
    # posture and ways take twice as long as the others: each counts for two
    yield
    yield
    return check_ways_home(machine, plan.rest_pose, homes, margins)


def check_legs(
    machine: Machine, plan: Plan, parent: Plan, before: Plan | None, margins: Margins
) -> Rejection | None:
    """Leg length, speed, acceleration, jerk on the grid; joints and the rest coarser."""
    return whole(check_legs_in_slices(machine, plan, parent, before, margins, None))


def check_legs_in_slices(
    machine: Machine,
    plan: Plan,
    parent: Plan,
    before: Plan | None,
    margins: Margins,
    block: int | None,
) -> Slices[Rejection | None]:
    """`check_legs`, with a rest after every ``block`` samples and every kind of limit."""
    # a long move is smooth: two thousand samples show it whole
    step = max(GRID, plan.duration / 2000.0)
    poses, legs, skipped = yield from _legs(machine, plan, parent, before, step, block)

    def at(row: int) -> float:
        return max(0.0, (row - skipped) * step)

    low, high = machine.leg_min + margins.stroke, machine.leg_max - margins.stroke
    for allowed, outside in ((low, legs < low), (high, legs > high)):
        if outside.any():
            first, short = (int(index) for index in np.argwhere(outside)[0])
            found = float(legs[first, short])
            return Rejection(Reason.LEG_LENGTH, at(first), short, found, allowed)
    moved = legs
    for order, reason, limit, share in (
        (1, Reason.LEG_SPEED, machine.leg_speed, margins.share),
        (2, Reason.LEG_ACCELERATION, machine.leg_acceleration, margins.share),
        (3, Reason.LEG_JERK, machine.leg_jerk, margins.jerk_share),
    ):
        moved = np.diff(moved, axis=0) / step
        if limit is None:
            continue
        size, spacing = np.abs(moved), step
        if order == 3 and limit * _DOUBTFUL < size.max() <= limit * share:
            # jerk changes between samples: seen from other instants it can be a third larger
            spacing = step / 2.0
            _, fine, _ = yield from _legs(machine, plan, parent, before, spacing, block)
            size = np.abs(np.diff(fine, 3, axis=0)) / spacing**3
        largest = float(size.max())
        if largest > limit * share:
            row, leg = np.unravel_index(int(size.argmax()), size.shape)
            when = max(0.0, (int(row) + order - skipped) * spacing)
            return Rejection(reason, when, int(leg), largest, limit * share)
    if machine.passenger_acceleration is not None:
        second = np.diff(poses[:, :3], 2, axis=0) / step**2
        size = np.linalg.norm(second, axis=1)
        largest, allowed = float(size.max()), machine.passenger_acceleration * margins.share
        if largest > allowed:
            return Rejection(Reason.PASSENGER, at(int(size.argmax()) + 2), None, largest, allowed)
    yield
    return _check_posture(machine, poses, margins, _POSTURE_EVERY, at)


def _check_posture(
    machine: Machine,
    poses: Array,
    margins: Margins,
    every: int,
    at: Callable[[int], float | None],
) -> Rejection | None:
    """Joint angles and conditioning at some of the poses (N, 6), the last one included."""
    rows = np.append(np.arange(0, len(poses), every), len(poses) - 1)
    poses = poses[rows]
    seen = leg_directions(machine, poses)
    if machine.joint_angle is not None:
        swing = joint_angles(machine, poses, seen)
        largest, allowed = float(swing.max()), machine.joint_angle - margins.swing
        if largest > allowed:
            row, _, leg = np.unravel_index(int(swing.argmax()), swing.shape)
            when = at(int(rows[row]))
            return Rejection(Reason.JOINT_ANGLE, when, int(leg), largest, allowed)
    if machine.conditioning is not None:
        allowed = machine.conditioning * neutral_conditioning(machine) * margins.conditioning
        if not is_conditioned(machine, poses, allowed, seen):
            found = conditioning(machine, poses)
            when = at(int(rows[found.argmin()]))
            return Rejection(Reason.CONDITIONING, when, None, float(found.min()), allowed)
    return None


def _legs(
    machine: Machine, plan: Plan, parent: Plan, before: Plan | None, step: float, block: int | None
) -> Slices[tuple[Array, Array, int]]:
    """Poses and legs on the grid, to three samples after the end; how many lie before it."""
    times: Array = np.arange(int(np.ceil(plan.duration / step)) + 4, dtype=np.float64) * step
    lead = _played_before(plan, parent, before, step)
    if block is None:
        poses = np.concatenate((lead, plan.poses(times)))
        return poses, leg_lengths(machine, poses), len(lead)
    skipped = len(lead)
    poses = np.empty((skipped + len(times), 6))
    poses[:skipped] = lead
    legs: Array = np.empty(poses.shape[::-1]).T
    for begin, end in blocks(len(poses), block):
        first = max(begin, skipped)
        poses[first:end] = plan.poses(times[first - skipped : end - skipped])
        legs[begin:end] = leg_lengths(machine, poses[begin:end])
        yield
    return poses, legs, skipped


def _played_before(plan: Plan, parent: Plan, before: Plan | None, step: float) -> Array:
    """The three samples before the hand-over, so that a jump there is seen; fewer if unknown."""
    instants = plan.takeover + np.array([-3.0, -2.0, -1.0]) * step
    out = parent.poses(instants[instants >= 0.0])
    if before is None:
        return out
    earlier = parent.takeover + instants[instants < 0.0]
    return np.concatenate((before.poses(earlier[earlier >= 0.0]), out))


def check_ways_home(
    machine: Machine, rest: Array, homes: Array, margins: Margins
) -> Rejection | None:
    """From the rest pose (6,) a straight, allowed way to each of the poses ``homes`` (H, 6)."""
    ways = straight_ways(machine, rest, homes)
    low, high = machine.leg_min + margins.stroke, machine.leg_max - margins.stroke
    for way in ways:
        beyond = max(low - float(way.legs.min()), float(way.legs.max()) - high)
        if beyond > 0.0:
            return Rejection(Reason.NO_WAY_HOME, None, None, beyond, 0.0)
        if way.duration > LONGEST_MOVE:
            return Rejection(Reason.NO_WAY_HOME, None, None, way.duration, LONGEST_MOVE)
    poses = np.concatenate([way.poses for way in ways])
    posture = _check_posture(machine, poses, margins, _WAY_EVERY, lambda row: None)
    if posture is not None:
        return Rejection(Reason.NO_WAY_HOME, None, posture.leg, posture.value, posture.allowed)
    return None
