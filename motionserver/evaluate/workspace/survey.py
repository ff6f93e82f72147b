"""Explore a machine's workspace: axes alone, planes, corners, random poses."""

from __future__ import annotations

from itertools import combinations, product
from typing import Final

import numpy as np

from motionserver.core.axes import Array
from motionserver.core.kinematics.hexapod import conditioning, joint_angles, neutral_conditioning
from motionserver.core.kinematics.reach import Exits, first_exits, reachable
from motionserver.core.limits import Machine
from motionserver.errors import ConfigError
from motionserver.evaluate.workspace.homing import FEW, park_higher, shares
from motionserver.evaluate.workspace.result import Corner, Extreme, Plane, Range, Survey

RAYS: Final = 72
"""Ways out of neutral in each plane."""
PAIRS: Final = tuple(combinations(range(6), 2))
"""All 15 planes, by the numbers of their axes."""
_WAYS: Final = 1000
_CORNERS: Final = np.array(list(product((1.0, -1.0), repeat=6)))


def survey(machine: Machine, box: Array | None = None) -> Survey:
    """Explore a machine, always from neutral outwards.

    Args:
        machine: Geometry and limits.
        box: Position limits of cueing, (6,) [m, rad]; the machine's own if None.

    Returns:
        All figures; the same for the same machine and box, whatever is random in it.

    Raises:
        ConfigError: Neutral itself is not reachable.
    """
    box = machine.box if box is None else box
    if not reachable(machine, np.zeros((1, 6)))[0]:
        raise ConfigError(
            f"machine {machine.name}",
            "neutral is beyond its own limits",
            "Check neutral_height, the joints, legs.min and legs.max.",
        )
    ranges, axis_exits = _ranges(machine, (0, 1, 2, 3, 4, 5), None)
    about_head: tuple[Range, ...] = ()
    if np.any(machine.head):
        about_head, _ = _ranges(machine, (3, 4, 5), machine.head)
    planes, plane_exits = _planes(machine, box, ranges)
    corner_exits = first_exits(machine, _CORNERS * box)
    own_exits = corner_exits
    if not np.array_equal(box, machine.box):
        own_exits = first_exits(machine, _CORNERS * machine.box)
    # any direction counts alike once each axis is measured by its own reach
    scales = np.array([0.5 * (one.high - one.low) for one in ranges])
    random = np.random.default_rng(1).normal(size=(_WAYS, 6)) * scales
    edge = np.concatenate(
        (
            axis_exits.poses,
            plane_exits.poses,
            corner_exits.poses,
            first_exits(machine, random).poses,
        )
    )
    drawn = shares(machine, box)
    return Survey(
        machine,
        box,
        ranges,
        about_head,
        planes,
        _corners(_CORNERS, corner_exits),
        _corners(_CORNERS, own_exits),
        drawn,
        park_higher(machine, box) if drawn[0].stranded > FEW else None,
        _least_conditioning(machine, edge),
        _largest_swing(machine, edge),
    )


def _ranges(
    machine: Machine, axes: tuple[int, ...], arm: Array | None
) -> tuple[tuple[Range, ...], Exits]:
    chosen = np.eye(6)[list(axes)]
    exits = first_exits(machine, np.concatenate((chosen, -chosen)), arm)
    count = len(axes)
    found = tuple(
        Range(
            axis,
            -float(exits.reach[count + row]),
            float(exits.reach[row]),
            exits.endings[count + row],
            exits.endings[row],
        )
        for row, axis in enumerate(axes)
    )
    return found, exits


def _planes(
    machine: Machine, box: Array, ranges: tuple[Range, ...]
) -> tuple[tuple[Plane, ...], Exits]:
    """All planes by one march: rays spaced evenly once each axis is measured by its reach."""
    scales = np.array([0.5 * (one.high - one.low) for one in ranges])
    angles = np.arange(RAYS) * (2.0 * np.pi / RAYS)
    squares = _CORNERS[:: 2**4, :2]
    each = RAYS + len(squares)
    directions = np.zeros((len(PAIRS), each, 6))
    for row, (first, second) in enumerate(PAIRS):
        directions[row, :RAYS, first] = scales[first] * np.cos(angles)
        directions[row, :RAYS, second] = scales[second] * np.sin(angles)
        directions[row, RAYS:, [first, second]] = (squares * box[[first, second]]).T
    exits = first_exits(machine, directions.reshape(-1, 6))
    planes = []
    for row, (first, second) in enumerate(PAIRS):
        rays = slice(row * each, row * each + RAYS)
        corners = range(row * each + RAYS, (row + 1) * each)
        worst = min(corners, key=lambda one: float(exits.reach[one]))
        signs = squares[worst - corners[0]]
        half = box[[first, second]] / scales[[first, second]]
        planes.append(
            Plane(
                first,
                second,
                exits.poses[rays][:, [first, second]],
                exits.endings[rays],
                _covered(exits.reach[rays], half),
                Corner(
                    (int(signs[0]), int(signs[1])), float(exits.reach[worst]), exits.endings[worst]
                ),
            )
        )
    return tuple(planes), exits


def _covered(reach: Array, half: Array) -> float:
    """Share of the rectangle of half sides ``half`` (2,) inside the star of radii (RAYS,)."""
    fine = np.arange(20 * RAYS) * (2.0 * np.pi / (20 * RAYS))
    closed = np.append(reach, reach[0])
    star = np.interp(fine, np.linspace(0.0, 2.0 * np.pi, RAYS + 1), closed)
    rectangle = 1.0 / np.maximum(np.abs(np.cos(fine)) / half[0], np.abs(np.sin(fine)) / half[1])
    return float(np.sum(np.minimum(star, rectangle) ** 2) / np.sum(rectangle**2))


def _corners(signs: Array, exits: Exits) -> tuple[Corner, ...]:
    return tuple(
        Corner(tuple(int(sign) for sign in row), float(scale), ending)
        for row, scale, ending in zip(signs, exits.reach, exits.endings, strict=True)
    )


def _least_conditioning(machine: Machine, poses: Array) -> Extreme:
    found = conditioning(machine, poses) / neutral_conditioning(machine)
    row = int(np.argmin(found))
    return Extreme(float(found[row]), machine.conditioning, tuple(poses[row].tolist()))


def _largest_swing(machine: Machine, poses: Array) -> Extreme:
    swing = joint_angles(machine, poses)
    row, _, leg = np.unravel_index(int(np.argmax(swing)), swing.shape)
    return Extreme(
        float(swing.max()), machine.joint_angle, tuple(poses[row].tolist()), int(leg) + 1
    )
