"""What a machine file may hold: keys, types, units; what the values mean together is judged later.

The bounds are wide on purpose: a value in the wrong unit shall be told with the likely slip.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from motionserver.core.axes import Array, frozen
from motionserver.core.limits import Machine, Pace

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0.0)]
Point = tuple[Number, Number, Number]
Joints = tuple[Point, Point, Point, Point, Point, Point]
Place = tuple[str | int, ...]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Legs(_Strict):
    """[legs]: pin to pin."""

    min: Positive
    max: Positive
    speed: Positive
    acceleration: Positive
    jerk: Positive | None = None


class Parked(_Strict):
    """Where the platform is left."""

    heave: Number = 0.0


class Workspace(_Strict):
    """[workspace]: limits beside the stroke."""

    joint_angle_deg: Positive | None = None
    conditioning: Positive | None = None
    passenger_acceleration: Positive | None = None
    parked: Parked


class Box(_Strict):
    """[table2]: single-axis maxima."""

    surge: Positive
    sway: Positive
    heave: Positive
    roll_deg: Positive
    pitch_deg: Positive
    yaw_deg: Positive

    def to_si(self) -> Array:
        """The six half widths, (6,) [m, rad]."""
        angles = np.radians([self.roll_deg, self.pitch_deg, self.yaw_deg])
        return frozen([self.surge, self.sway, self.heave, *angles])


class PaceSection(_Strict):
    """[pace]: raising and parking, per leg."""

    speed: Positive
    acceleration: Positive
    jerk: Positive


class MachineFile(_Strict):
    """The whole file."""

    name: Annotated[str, Field(min_length=1, max_length=60)]
    neutral_height: Positive
    base_joints: Joints
    platform_joints: Joints
    head: Point = (0.0, 0.0, 0.0)
    legs: Legs
    workspace: Workspace
    table2: Box | None = None
    pace: PaceSection

    def to_machine(self, box: Array) -> Machine:
        """The machine in SI.

        Args:
            box: Single-axis maxima, (6,) [m, rad].
        """
        angle = self.workspace.joint_angle_deg
        return Machine(
            name=self.name,
            base_joints=frozen(self.base_joints),
            platform_joints=frozen(self.platform_joints),
            neutral_height=self.neutral_height,
            leg_min=self.legs.min,
            leg_max=self.legs.max,
            leg_speed=self.legs.speed,
            leg_acceleration=self.legs.acceleration,
            leg_jerk=self.legs.jerk,
            joint_angle=None if angle is None else float(np.radians(angle)),
            conditioning=self.workspace.conditioning,
            passenger_acceleration=self.workspace.passenger_acceleration,
            head=frozen(self.head),
            parked_pose=frozen([0.0, 0.0, self.workspace.parked.heave, 0.0, 0.0, 0.0]),
            box=box,
            pace=Pace(self.pace.speed, self.pace.acceleration, self.pace.jerk),
        )


@dataclass(frozen=True, slots=True)
class Complaint:
    """Why a machine file is refused.

    Attributes:
        place: The key.
        what: What is wrong with it, its value and what is allowed included.
        do: What to do.
        is_open: True if that is to be said beside a slip that was found; else the slip stands
            alone.
        is_plain: True if no slip is looked for: the value is only a little too large.
    """

    place: Place
    what: str
    do: str
    is_open: bool = False
    is_plain: bool = False
