"""Whether speeds, accelerations and jerks of a machine file fit the stroke and each other."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf
from typing import Final

from motionserver.settings.machine_file import Complaint, MachineFile

PACE_SHARE: Final = 0.9
"""Most of a leg limit that raising and parking may use: a move must pass the same check."""
_CROSSING: Final = (0.04, 60.0)
"""Time in which a leg at full speed crosses its stroke [s]."""
_RUN_UP: Final = 5.0
"""Most strokes that a leg may need to reach its speed."""
_RISES: Final = (0.2, 2000.0)
"""Jerk over acceleration: acceleration is reached in 0.5 ms to 5 s [1/s]."""
_LITTLE: Final = 1.5
"""Times a limit up to which a pace is taken for a wish, and not for another unit."""


def leg_complaints(data: MachineFile) -> Iterator[Complaint]:
    """What is wrong with the legs' own limits."""
    legs = data.legs
    stroke = legs.max - legs.min
    crossing = stroke / legs.speed
    if not _CROSSING[0] <= crossing <= _CROSSING[1]:
        yield Complaint(
            ("legs", "speed"),
            f"at {legs.speed:g} m/s a leg crosses its stroke of {stroke:.3g} m in {crossing:.2g} "
            f"s, allowed is {_CROSSING[0]:g} to {_CROSSING[1]:g} s: such a limit guards nothing",
            f"Give what the actuators reach, at most {stroke / _CROSSING[0]:.3g} m/s.",
        )
    run_up = 0.5 * legs.speed**2 / legs.acceleration
    if run_up > _RUN_UP * stroke:
        yield Complaint(
            ("legs", "speed"),
            f"to reach {legs.speed:g} m/s at legs.acceleration = {legs.acceleration:g} m/s2 a leg "
            f"needs {run_up:.3g} m, and its stroke is {stroke:.3g} m",
            "Give a speed that the actuators reach, or their acceleration.",
        )
    yield from _rise("legs", legs.jerk, legs.acceleration)


def _rise(section: str, jerk: float | None, acceleration: float) -> Iterator[Complaint]:
    rise = inf if jerk is None else jerk / acceleration
    if jerk is not None and not _RISES[0] <= rise <= _RISES[1]:
        yield Complaint(
            (section, "jerk"),
            f"at {jerk:g} m/s3 the {acceleration:g} m/s2 of {section}.acceleration are reached in "
            f"{1.0 / rise:.2g} s, allowed is {1.0 / _RISES[1]:g} to {1.0 / _RISES[0]:g} s",
            f"Give {_RISES[0] * acceleration:g} to {_RISES[1] * acceleration:g}.",
        )


def pace_complaints(data: MachineFile) -> Iterator[Complaint]:
    """What is wrong with the pace of raising and parking."""
    legs, pace = data.legs, data.pace
    for what, value, limit in (
        ("speed", pace.speed, legs.speed),
        ("acceleration", pace.acceleration, legs.acceleration),
        ("jerk", pace.jerk, legs.jerk),
    ):
        if limit is not None and value > PACE_SHARE * limit:
            yield Complaint(
                ("pace", what),
                f"{value:g} is more than {PACE_SHARE:.0%} of the legs' own limit {limit:g}",
                f"Raise and park more gently: at most {PACE_SHARE * limit:g}.",
                is_open=True,
                is_plain=value < _LITTLE * limit,
            )
    yield from _rise("pace", pace.jerk, pace.acceleration)
