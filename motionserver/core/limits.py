"""The machine: geometry and hard limits, read once, hashed, never tunable."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, fields, replace

import numpy as np

from motionserver.core.axes import Array, frozen


@dataclass(frozen=True, slots=True)
class Pace:
    """How gently a rest-to-rest move is made; limits of each leg along it.

    Attributes:
        speed: Leg speed [m/s].
        acceleration: Leg acceleration [m/s2].
        jerk: Leg jerk [m/s3].
    """

    speed: float
    acceleration: float
    jerk: float


@dataclass(frozen=True, slots=True, eq=False)
class Machine:
    """A hexapod and what it may never leave. Lengths are pin to pin.

    Attributes:
        name: Name of the preset or file.
        base_joints: Lower joints, (6, 3), in the base plane frame [m].
        platform_joints: Upper joints, (6, 3), relative to the motion reference point [m].
        neutral_height: Height of the motion reference point over the base origin at neutral [m].
        leg_min: Shortest leg [m].
        leg_max: Longest leg [m].
        leg_speed: Largest leg speed [m/s].
        leg_acceleration: Largest leg acceleration [m/s2].
        leg_jerk: Largest leg jerk [m/s3]; None = not checked.
        joint_angle: Largest swing of a joint about the neutral leg direction [rad]; None = not
            checked.
        conditioning: Least sigma_min of the Jacobian as a share of its neutral value [-]; None =
            not checked.
        passenger_acceleration: Largest translational acceleration of the reference point
            [m/s2]; None = not checked.
        head: Driver's head in the platform frame from the reference point, (3,) [m].
        parked_pose: Where the platform is left when parked, (6,).
        box: Single-axis maxima (Table 2 of Thoendel 2014), (6,) [m, rad].
        pace: Leg limits of raising and parking.
    """

    name: str
    base_joints: Array
    platform_joints: Array
    neutral_height: float
    leg_min: float
    leg_max: float
    leg_speed: float
    leg_acceleration: float
    leg_jerk: float | None
    joint_angle: float | None
    conditioning: float | None
    passenger_acceleration: float | None
    head: Array
    parked_pose: Array
    box: Array
    pace: Pace

    @property
    def digest(self) -> str:
        """Short hash of everything above, shown wherever the limits matter."""
        text = ";".join(f"{f.name}={_exact(getattr(self, f.name))}" for f in fields(self))
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def with_head(self, head: Array) -> Machine:
        """The same machine with another head point (3,) [m]."""
        return replace(self, head=frozen(head))


def _exact(value: object) -> str:
    if isinstance(value, np.ndarray):
        return value.astype("<f8").tobytes().hex()
    if isinstance(value, Pace):
        return f"{value.speed!r},{value.acceleration!r},{value.jerk!r}"
    return repr(value)


def machine_from_mapping(data: dict[str, object]) -> Machine:
    """Rebuild a machine from the plain mapping of `machine_to_mapping` (SI throughout)."""
    arrays = {"base_joints", "platform_joints", "head", "parked_pose", "box"}
    values: dict[str, object] = {
        key: frozen(value) if key in arrays else value for key, value in data.items()
    }
    values["pace"] = Pace(**data["pace"])  # type: ignore[arg-type]
    return Machine(**values)  # type: ignore[arg-type]


def machine_to_mapping(machine: Machine) -> dict[str, object]:
    """Write a machine as a mapping of plain numbers and lists, for JSON between processes."""
    out: dict[str, object] = {}
    for field in fields(machine):
        value = getattr(machine, field.name)
        if isinstance(value, np.ndarray):
            value = value.tolist()
        elif isinstance(value, Pace):
            value = {f.name: getattr(value, f.name) for f in fields(value)}
        out[field.name] = value
    return out
