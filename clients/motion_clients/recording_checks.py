"""What looks wrong in a recording that can be read: each one line, with the likely slip."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import hypot
from statistics import median
from typing import Final

GAP: Final = 0.3
"""After a longer silence the server takes the cue as lost, whatever the rate [s]."""
SHORTEST: Final = 2.0
"""A shorter recording says little about cueing [s]."""
FASTEST: Final = 120.0
"""Speed beyond that of vehicles on the ground and of light aircraft [m/s]."""
FASTEST_TURN: Final = 12.0
"""Rate of turning beyond that of vehicles [rad/s]."""
WEAKEST: Final = 1.0
"""A drive with no larger acceleration is hardly one [m/s^2]."""
_G: Final = 9.81
_STANDING: Final = 0.1  # speed [m/s]
_ALIKE: Final = 0.8  # correlation of change of speed and acceleration

Columns = Sequence[float]


def time_warnings(times: Columns, lines: Sequence[int], has_unit: bool) -> list[str]:
    """Gaps, milliseconds, and lengths that say little."""
    steps = [b - a for a, b in pairwise(times)]
    usual = median(steps)
    out = []
    if usual >= 1.0 and not has_unit:
        out.append(
            f"line {lines[1]}, column t: steps of {usual:g} s are far apart: in ms? Then name the "
            "column t [ms], or divide it by 1000"
        )
    else:
        out += _gaps(times, lines, steps, usual)
    length = times[-1] - times[0]
    if length < SHORTEST:
        out.append(
            f"column t: only {length:.3g} s long, too little to judge by: record more, or name the "
            "unit of t if it is not seconds"
        )
    return out


def _gaps(times: Columns, lines: Sequence[int], steps: Columns, usual: float) -> list[str]:
    gaps = [k for k, step in enumerate(steps) if step > max(GAP, 5.0 * usual)]
    if usual > GAP:
        return [
            f"column t: samples {usual:g} s apart, the server takes a cue as lost after {GAP:g} s: "
            "record at 20 Hz or faster"
        ]
    if not gaps:
        return []
    worst = max(gaps, key=lambda k: steps[k])
    more = "" if len(gaps) == 1 else f", the longest of {len(gaps)} gaps"
    return [
        f"line {lines[worst + 1]}, column t: a gap, {steps[worst]:.2f} s are missing after "
        f"{times[worst]:g} s{more}: the cue fades out there as live; cut the drive in parts, or "
        "record it again"
    ]


def acceleration_warnings(
    accelerations: Sequence[Columns], speeds: Columns, names: Sequence[str], is_force: bool
) -> list[str]:
    """Gravity left in or missing, g instead of m/s^2: what an axis reads at standstill tells.

    Args:
        accelerations: Columns x, y, z as they stand in the file.
        speeds: Forward speed [m/s].
        names: Of the three columns.
        is_force: True if they are specific force, gravity included.
    """
    standing = [k for k, v in enumerate(speeds) if abs(v) < _STANDING]
    where = "at standstill"
    if len(standing) < max(10, len(speeds) // 100):
        standing, where = list(range(len(speeds))), "in the median"
    rest = [median(column[k] for k in standing) for column in accelerations]
    if is_force:
        return _of_force(rest, names, where)
    level, axis = max((abs(value), axis) for axis, value in enumerate(rest))
    name, value = names[axis], rest[axis]
    kinematic = "ax, ay, az are kinematic accelerations, 0 at rest"
    fix = "subtract gravity, or name the columns fx,fy,fz if they are specific force"
    if 0.9 * _G < level < 1.1 * _G:
        return [
            f"column {name}: reads {value:.2f} m/s2 {where}: gravity was left in; {kinematic}: "
            f"{fix}"
        ]
    if axis == 2 and 0.95 < level < 1.05:
        return [
            f"column {name}: reads {value:.3g} {where}: gravity was left in, and the unit is g? "
            f"{kinematic}: name the columns fx [g], fy [g], fz [g]"
        ]
    return []


def _of_force(rest: Columns, names: Sequence[str], where: str) -> list[str]:
    value = rest[2]
    if 0.8 * _G < value < 1.2 * _G:
        return []
    slip = "an accelerometer at rest reads 9.81 in z: check axes and units"
    if abs(value) < 0.5 and hypot(*rest[:2]) < 0.5 * _G:
        slip = "gravity was taken out: name the columns ax,ay,az"
    elif 0.9 < value < 1.1:
        slip = f"in g? Then name the columns {names[0]} [g], {names[1]} [g], {names[2]} [g]"
    elif -1.2 * _G < value < -0.8 * _G:
        slip = "z points down? It points up here: change the signs of y and z, and of q and r"
    return [f"column {names[2]}: reads {value:.3g} m/s2 {where}: {slip}"]


def unit_warnings(
    times: Columns, forward: Columns, others: Sequence[Columns], speeds: Columns, has_unit: bool
) -> list[str]:
    """Units g instead of m/s^2, km/h instead of m/s, by what acceleration does to speed.

    Args:
        times: [s].
        forward: Acceleration forward, gravity removed [m/s^2].
        others: To the left and up.
        speeds: Forward speed [m/s].
        has_unit: True if the file names the unit of accelerations: then it is believed.
    """
    if max(map(abs, speeds)) > FASTEST:
        return [f"column v: up to {max(map(abs, speeds)):.0f} m/s: in km/h? Then name it v [km/h]"]
    ratio = _speed_over_acceleration(times, forward, speeds)
    if ratio is not None and 7.0 < ratio < 13.0 and not has_unit:
        return [
            f"column ax: the speed changes {ratio:.1f} times as fast as it says: in g? Then name "
            "the columns ax [g], ay [g], az [g]"
        ]
    if ratio is not None and 2.9 < ratio < 4.4:
        return [
            f"column v: it changes {ratio:.1f} times as fast as ax says: in km/h? Then name the "
            "column v [km/h]"
        ]
    if ratio is not None and ratio < -0.3:
        return [
            "column ax: positive where the speed falls: x points forward here, y left, z up; "
            "change the signs"
        ]
    peak = max(max(map(abs, column)) for column in (forward, *others))
    if peak < WEAKEST and not has_unit:
        return [
            f"columns ax, ay, az: none is ever above {peak:.2g} m/s2: in g? Then name the columns "
            "ax [g], ay [g], az [g]; if the vehicle hardly moved, there is little to judge by"
        ]
    return []


def angle_warnings(
    rates: Sequence[Columns], attitude: Sequence[Columns], has_unit: tuple[bool, bool]
) -> list[str]:
    """Degrees instead of radians: attitudes and rates beyond what vehicles do."""
    out = []
    fastest = max(max(map(abs, column)) for column in rates)
    if fastest > FASTEST_TURN and not has_unit[0]:
        out.append(
            f"columns p, q, r: up to {fastest:.0f} rad/s: in deg/s? Then name the columns "
            "p [deg/s], q [deg/s], r [deg/s]"
        )
    roll, pitch = (max(map(abs, column)) for column in attitude)
    if (roll > 3.2 or pitch > 1.6) and not has_unit[1]:
        out.append(
            f"columns roll, pitch: up to {max(roll, pitch):.1f} rad: in degrees? Then name the "
            "columns roll [deg], pitch [deg]"
        )
    return out


def _speed_over_acceleration(times: Columns, forward: Columns, speeds: Columns) -> float | None:
    """How fast the speed changes over what acceleration says, over seconds; None if unclear."""
    told, seen = [], []
    begin = 0
    grown = 0.0
    for k in range(1, len(times)):
        grown += 0.5 * (forward[k] + forward[k - 1]) * (times[k] - times[k - 1])
        if times[k] - times[begin] >= 1.0:
            told.append(grown)
            seen.append(speeds[k] - speeds[begin])
            begin, grown = k, 0.0
    squares = sum(value * value for value in told)
    changes = sum(value * value for value in seen)
    if len(told) < 5 or changes < 0.25 * len(seen) or squares == 0.0:
        return None
    product = sum(a * b for a, b in zip(told, seen, strict=True))
    if abs(product) < _ALIKE * (squares * changes) ** 0.5:
        return None
    return product / squares
