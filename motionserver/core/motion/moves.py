"""Rest-to-rest moves: a quintic in time, straight in pose space, as slow as its legs need."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from motionserver.core.axes import Array, frozen
from motionserver.core.kinematics.hexapod import leg_lengths
from motionserver.core.limits import Machine
from motionserver.core.plan import Plan

SAMPLES = 65
"""Poses along the straight way whose legs are computed."""
SHORTEST = 0.5
"""Shortest move [s]."""

_SHARES = np.linspace(0.0, 1.0, SAMPLES)[:, None]

# largest first, second and third derivative of the quintic 10 t^3 - 15 t^4 + 6 t^5 on [0, 1]
_RATE, _BEND, _SNAP = 1.875, 5.7735027, 60.0


@dataclass(frozen=True, slots=True)
class StraightWay:
    """The straight line in pose space between two rest poses.

    Attributes:
        poses: Along the way, ends included, (SAMPLES, 6).
        legs: Their leg lengths, (SAMPLES, 6) [m].
        duration: Time in which no leg exceeds the machine's pace [s].
    """

    poses: Array
    legs: Array
    duration: float


def straight_way(machine: Machine, start: Array, goal: Array) -> StraightWay:
    """The way from ``start`` to ``goal``, both (6,): see `straight_ways`."""
    return straight_ways(machine, start, goal[None])[0]


def straight_ways(machine: Machine, start: Array, goals: Array) -> list[StraightWay]:
    """Lay the ways to several goals and bound their durations by the chain rule.

    With l(s) the lengths along the way and s(t) the quintic: l' <= L1 s', l'' <= L1 s'' + L2 s'^2,
    l''' <= L1 s''' + 3 L2 s' s'' + L3 s'^3, each term at its largest.

    Args:
        machine: Geometry and pace.
        start: Pose to leave, (6,).
        goals: Poses to reach, (H, 6).

    Returns:
        One way per goal; whether their legs are allowed is not judged here.
    """
    poses = start + _SHARES * (goals - start)[:, None]
    legs = leg_lengths(machine, poses.reshape(-1, 6)).reshape(poses.shape)
    slopes = legs
    largest = []
    for _ in range(3):
        slopes = (slopes[:, 1:] - slopes[:, :-1]) * (SAMPLES - 1)
        largest.append(np.abs(slopes).max((1, 2)))
    pace = machine.pace
    ways = []
    for way, lengths, l1, l2, l3 in zip(poses, legs, *largest, strict=True):
        duration = max(
            SHORTEST,
            _RATE * l1 / pace.speed,
            ((_BEND * l1 + _RATE**2 * l2) / pace.acceleration) ** 0.5,
            ((_SNAP * l1 + 3 * _RATE * _BEND * l2 + _RATE**3 * l3) / pace.jerk) ** (1 / 3),
        )
        ways.append(StraightWay(way, lengths, float(duration)))
    return ways


def rest_to_rest(
    plan_id: int, parent_id: int, takeover: float, start: Array, goal: Array, duration: float
) -> Plan:
    """One quintic between two rest poses (6,), made in ``duration`` [s]."""
    still = frozen(np.zeros((2, 6)))
    return Plan(
        plan_id,
        parent_id,
        takeover,
        frozen([0.0, duration]),
        frozen(np.stack((start, goal))),
        still,
        still,
    )
