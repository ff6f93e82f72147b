"""Everything that is found out about a machine's workspace, as plain numbers."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, product
from typing import Final

import numpy as np

from motionserver.core.axes import AXIS_NAMES, Array
from motionserver.core.kinematics.hexapod import conditioning, joint_angles, neutral_conditioning
from motionserver.core.limits import Machine
from motionserver.errors import ConfigError
from motionserver.evaluate.workspace.homing import FEW, Share, park_higher, shares
from motionserver.evaluate.workspace.reach import Ending, Exits, first_exits, reachable

RAYS: Final = 72
"""Ways out of neutral in each plane."""
PAIRS: Final = tuple(combinations(range(6), 2))
"""All 15 planes, by the numbers of their axes."""
_WAYS: Final = 1000
_CORNERS: Final = np.array(list(product((1.0, -1.0), repeat=6)))


@dataclass(frozen=True, slots=True)
class Range:
    """How far one axis goes alone.

    Attributes:
        axis: 0..5.
        low: Negative end [m or rad].
        high: Positive end [m or rad].
        low_end: What ends it there.
        high_end: What ends it there.
    """

    axis: int
    low: float
    high: float
    low_end: Ending
    high_end: Ending

    @property
    def name(self) -> str:
        """Of the axis."""
        return AXIS_NAMES[self.axis]


@dataclass(frozen=True, slots=True)
class Corner:
    """A corner of a box, and how far the way to it goes.

    Attributes:
        signs: +1 or -1 for each axis of the box.
        scale: Largest share of the way to the corner that is reachable; above 1: all of it.
        ending: What ends the way.
    """

    signs: tuple[int, ...]
    scale: float
    ending: Ending


@dataclass(frozen=True, slots=True, eq=False)
class Plane:
    """The reachable part of the plane of two axes, all others neutral.

    Attributes:
        first: Axis drawn to the right, 0..5.
        second: Axis drawn upwards.
        edge: Boundary, (RAYS, 2) [m or rad], counter-clockwise from the first axis.
        endings: What ends the workspace at each of its points.
        share: Share of the box's rectangle that is reachable.
        worst: The corner of that rectangle of which least is reachable.
    """

    first: int
    second: int
    edge: Array
    endings: tuple[Ending, ...]
    share: float
    worst: Corner

    @property
    def name(self) -> str:
        """Both axes."""
        return f"{AXIS_NAMES[self.first]}-{AXIS_NAMES[self.second]}"


@dataclass(frozen=True, slots=True)
class Extreme:
    """The most extreme value on the edge of the workspace.

    Attributes:
        value: Share of the neutral sigma_min [-], or joint swing [rad].
        limit: The machine's; None if it states none.
        pose: Where, 6 values.
        leg: 1..6 for a joint, else 0.
    """

    value: float
    limit: float | None
    pose: tuple[float, ...]
    leg: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Survey:
    """The workspace of a machine.

    Attributes:
        machine: Geometry and limits.
        box: The box that cueing is allowed, (6,) [m, rad].
        ranges: The six axes alone.
        about_head: Roll, pitch and yaw about a head that stays in place; empty if the head is the
            motion reference point.
        planes: All 15, in the order of `PAIRS`.
        corners: The 64 corners of the box.
        machine_corners: The same of the machine's own box.
        shares: Of random poses in the box, drawn smaller and smaller.
        parking: A parked heave [m] that leaves few poses without a way home, and the share that it
            leaves; None if there are few already, or no height helps.
        conditioning: Least sigma_min on the edge, as a share of neutral's.
        swing: Largest joint angle on the edge.
    """

    machine: Machine
    box: Array
    ranges: tuple[Range, ...]
    about_head: tuple[Range, ...]
    planes: tuple[Plane, ...]
    corners: tuple[Corner, ...]
    machine_corners: tuple[Corner, ...]
    shares: tuple[Share, ...]
    parking: tuple[float, float] | None
    conditioning: Extreme
    swing: Extreme


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
