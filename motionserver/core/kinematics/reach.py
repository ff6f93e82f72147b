"""Which poses a machine reaches, how far it gets along a way out of neutral, and what ends it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

import numpy as np

from motionserver.core.axes import Array, Bools
from motionserver.core.kinematics.hexapod import (
    conditioning,
    jacobian,
    joint_angles,
    leg_lengths,
    neutral_conditioning,
    surely_conditioned,
)
from motionserver.core.kinematics.rotation import rotation
from motionserver.core.limits import Machine

STEPS: Final = 64
"""Samples along a way while its fastest leg, at neutral's slope, uses up the whole stroke."""
_BLOCK: Final = 16
_FARTHEST: Final = 12
"""Where a way is given up, in strokes of its fastest leg."""
_STEEPEST: Final = np.radians(80.0)
"""Largest roll, pitch or yaw that is looked at: Euler angles fail at 90 deg of pitch."""
_HALVINGS: Final = 30
_TOGETHER: Final = 1e-5
"""Legs this close to the same limit end a way together [m or rad]: mirror images do."""


class Limit(StrEnum):
    """What ends a way out of neutral."""

    LONGEST = "longest"
    SHORTEST = "shortest"
    JOINT = "joint angle"
    CONDITIONING = "conditioning"
    NOTHING = "nothing"


@dataclass(frozen=True, slots=True)
class Ending:
    """What ends a way.

    Attributes:
        limit: Which limit.
        legs: Numbers 1..6 of the legs that stand at it; empty where no leg is to blame.
    """

    limit: Limit
    legs: tuple[int, ...] = ()

    def __str__(self) -> str:
        if not self.legs:
            return str(self.limit)
        plural = "s" if len(self.legs) > 1 else ""
        return f"leg{plural} {', '.join(map(str, self.legs))} {self.limit}"


@dataclass(frozen=True, slots=True, eq=False)
class Exits:
    """Where ways out of neutral first leave the workspace.

    Attributes:
        reach: Last reachable parameter of each way, (N,); the pose is the way's there.
        poses: Those poses, (N, 6).
        endings: What ends each way.
    """

    reach: Array
    poses: Array
    endings: tuple[Ending, ...]


def reachable(machine: Machine, poses: Array) -> Bools:
    """Whether stroke, joint angles and conditioning allow each of the poses (N, 6): bool (N,).

    The limits are the machine's own; the guard keeps small margins to them.
    """
    legs = leg_lengths(machine, poses)
    allowed: Bools = np.all((legs >= machine.leg_min) & (legs <= machine.leg_max), axis=1)
    rows = np.flatnonzero(allowed)
    allowed[rows] = posture_allowed(machine, poses[rows])
    return allowed


def posture_allowed(machine: Machine, poses: Array) -> Bools:
    """Whether joint angles and conditioning alone allow each of the poses (N, 6): bool (N,)."""
    allowed: Bools = np.ones(len(poses), dtype=bool)
    if machine.joint_angle is not None:
        allowed = joint_angles(machine, poses).max((1, 2)) <= machine.joint_angle
    if machine.conditioning is not None:
        rows = np.flatnonzero(allowed)
        least = machine.conditioning * neutral_conditioning(machine)
        rows = rows[~surely_conditioned(machine, poses[rows], least)]
        if len(rows):
            allowed[rows] = conditioning(machine, poses[rows]) >= least
    return allowed


def first_exits(machine: Machine, directions: Array, arm: Array | None = None) -> Exits:
    """Follow ways out of neutral to where they first leave the workspace.

    Each way is sampled outwards until a sample is not reachable, then halved between the last
    two; so a pose behind a gap does not count, though its own legs may be allowed.

    Args:
        machine: Geometry and limits.
        directions: Pose per unit of the parameter, (N, 6) [m, rad]; none of them zero.
        arm: Point of the platform that the rotation is to leave in place, from the motion
            reference point (3,) [m]: the reference point then moves by arm - R arm on top.

    Returns:
        One exit for each direction.
    """
    count = len(directions)
    slopes = directions.copy()
    if arm is not None:
        slopes[:, :3] -= np.cross(directions[:, 3:], arm)
    fastest = np.abs(slopes @ jacobian(machine, np.zeros((1, 6)))[0].T).max(1)
    stroke = machine.leg_max - machine.leg_min
    steepest = np.abs(directions[:, 3:]).max(1)
    far = np.minimum(_FARTHEST * stroke / fastest, _STEEPEST / np.maximum(steepest, 1e-12))
    step = stroke / fastest / STEPS
    inside, outside = np.zeros(count), far.copy()
    running = np.arange(count)
    done = 0
    while len(running):
        marks = step[running, None] * np.arange(done + 1, done + _BLOCK + 1)
        marks = np.minimum(marks, far[running, None])
        poses = _poses(directions[running].repeat(_BLOCK, axis=0), marks.ravel(), arm)
        good = reachable(machine, poses).reshape(marks.shape)
        first = np.where(good.all(1), _BLOCK, np.argmin(good, axis=1))
        before = np.concatenate((inside[running, None], marks), axis=1)
        inside[running] = np.take_along_axis(before, first[:, None], 1)[:, 0]
        left = first < _BLOCK
        outside[running[left]] = marks[left, first[left]]
        running = running[~left & (inside[running] < far[running])]
        done += _BLOCK
    for _ in range(_HALVINGS):
        middle = 0.5 * (inside + outside)
        good = reachable(machine, _poses(directions, middle, arm))
        inside, outside = np.where(good, middle, inside), np.where(good, outside, middle)
    beyond = _poses(directions, outside, arm)
    return Exits(inside, _poses(directions, inside, arm), endings(machine, beyond))


def _poses(directions: Array, marks: Array, arm: Array | None) -> Array:
    poses: Array = directions * marks[:, None]
    if arm is not None:
        poses[:, :3] += arm - np.matmul(rotation(poses[:, 3:]), arm)
    return poses


def endings(machine: Machine, poses: Array) -> tuple[Ending, ...]:
    """Which limit each of the poses (N, 6), a hair outside the workspace, is beyond."""
    legs = leg_lengths(machine, poses)
    swing = joint_angles(machine, poses).max(1)
    most = np.inf if machine.joint_angle is None else machine.joint_angle
    excesses = (
        (Limit.LONGEST, legs - machine.leg_max),
        (Limit.SHORTEST, machine.leg_min - legs),
        (Limit.JOINT, swing - most),
    )
    outside = ~reachable(machine, poses)
    out = []
    for row in range(len(poses)):
        limit, excess = max(excesses, key=lambda item: float(item[1][row].max()))
        if float(excess[row].max()) > 0.0:
            close = np.flatnonzero(excess[row] > -_TOGETHER)
            out.append(Ending(limit, tuple(int(leg) + 1 for leg in close)))
        else:
            out.append(Ending(Limit.CONDITIONING if outside[row] else Limit.NOTHING))
    return tuple(out)


def single_axis_reach(machine: Machine) -> Array:
    """What each axis reaches alone out of neutral, to its nearer side, (6,) [m, rad].

    Rounded down to 0.1 mm and 0.01 deg, so that a box of it is inside.
    """
    both = first_exits(machine, np.concatenate((np.eye(6), -np.eye(6)))).reach
    nearer = np.minimum(both[:6], both[6:])
    grain = np.array([1e-4] * 3 + [np.radians(0.01)] * 3)
    rounded: Array = np.floor(nearer / grain) * grain
    return rounded
