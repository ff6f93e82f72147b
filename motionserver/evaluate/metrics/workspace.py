"""A judge of its own over the executed samples: margins to every limit, and violations."""

from __future__ import annotations

from dataclasses import dataclass
from math import degrees

import numpy as np

from motionserver.core.axes import Array
from motionserver.core.kinematics.hexapod import (
    conditioning,
    joint_angles,
    neutral_conditioning,
)
from motionserver.core.limits import Machine

_COARSE_STEP = 0.01


@dataclass(frozen=True, slots=True)
class Margin:
    """How near one limit came.

    Attributes:
        name: Which limit.
        unit: Of the three numbers below.
        worst: The value nearest to the limit, or farthest beyond it.
        limit: The limit; None if the machine has none.
        margin: What is left; negative beyond the limit; None without a limit.
        violations: Samples beyond it.
    """

    name: str
    unit: str
    worst: float
    limit: float | None
    margin: float | None
    violations: int


@dataclass(frozen=True, slots=True)
class WorkspaceFigures:
    """Use of the machine.

    Attributes:
        margins: One for each limit.
        violations: Samples beyond any limit; must be 0.
        stroke_used: Share of the stroke between the 1st and 99th percentile, of the leg that uses
            most.
        stroke_used_mean: Mean over the legs.
        excursion: Largest distance of each pose coordinate from neutral, (6 values) [m, rad].
    """

    margins: tuple[Margin, ...]
    violations: int
    stroke_used: float
    stroke_used_mean: float
    excursion: tuple[float, ...]


def workspace_figures(machine: Machine, pose: Array, legs: Array, dt: float) -> WorkspaceFigures:
    """Judge poses (N, 6) and pin-to-pin legs (N, 6) ``dt`` [s] apart, by plain differences."""
    speed = np.diff(legs, axis=0) / dt
    acceleration = np.diff(legs, 2, axis=0) / dt**2
    jerk = np.diff(legs, 3, axis=0) / dt**3
    coarse = pose[:: max(1, round(_COARSE_STEP / dt))]
    steadiness = conditioning(machine, coarse) / neutral_conditioning(machine)
    swing = np.degrees(joint_angles(machine, coarse))
    largest_swing = None if machine.joint_angle is None else degrees(machine.joint_angle)
    margins = [
        _least("shortest leg", "mm", 1e3 * legs, 1e3 * machine.leg_min),
        _most("longest leg", "mm", 1e3 * legs, 1e3 * machine.leg_max),
        _most("leg speed", "m/s", np.abs(speed), machine.leg_speed),
        _most("leg acceleration", "m/s2", np.abs(acceleration), machine.leg_acceleration),
        _most("leg jerk", "m/s3", np.abs(jerk), machine.leg_jerk),
        _most("joint angle", "deg", swing, largest_swing),
        _least("sigma_min / neutral", "-", steadiness, machine.conditioning),
    ]
    if machine.passenger_acceleration is not None:
        second = np.linalg.norm(np.diff(pose[:, :3], 2, axis=0), axis=1) / dt**2
        margins.append(
            _most("passenger acceleration", "m/s2", second, machine.passenger_acceleration)
        )
    low, high = np.percentile(legs, (1, 99), axis=0)
    used = (high - low) / (machine.leg_max - machine.leg_min)
    return WorkspaceFigures(
        tuple(margins),
        sum(margin.violations for margin in margins),
        float(used.max()),
        float(used.mean()),
        tuple(float(x) for x in np.abs(pose).max(axis=0)),
    )


def _most(name: str, unit: str, values: Array, limit: float | None) -> Margin:
    worst = float(values.max()) if values.size else 0.0
    if limit is None:
        return Margin(name, unit, worst, None, None, 0)
    return Margin(name, unit, worst, limit, limit - worst, int(np.sum(values > limit)))


def _least(name: str, unit: str, values: Array, limit: float | None) -> Margin:
    worst = float(values.min()) if values.size else 0.0
    if limit is None:
        return Margin(name, unit, worst, None, None, 0)
    return Margin(name, unit, worst, limit, worst - limit, int(np.sum(values < limit)))
