"""What a survey of a machine's workspace holds, as plain numbers."""

from __future__ import annotations

from dataclasses import dataclass

from motionserver.core.axes import AXIS_NAMES, Array
from motionserver.core.kinematics.reach import Ending
from motionserver.core.limits import Machine
from motionserver.evaluate.workspace.homing import Share


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
        edge: Boundary, (`survey.RAYS`, 2) [m or rad], counter-clockwise from the first axis.
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
        planes: All 15, in the order of `survey.PAIRS`.
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
