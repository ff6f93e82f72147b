"""Where what was tuned and what is reachable disagree, each with what to do about it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from motionserver.core.axes import Array
from motionserver.core.kinematics.reach import Limit
from motionserver.evaluate.workspace.result import Range, Survey
from motionserver.evaluate.workspace.words import TOWARDS, amount

ROUNDING: Final = 0.01
"""A box this share beyond the reach is the rounding of a data sheet, not a mistake."""


@dataclass(frozen=True, slots=True)
class Advice:
    """One warning.

    Attributes:
        what: What disagrees, a sentence without full stop.
        do: What to do, a sentence with full stop.
    """

    what: str
    do: str

    def __str__(self) -> str:
        return f"{self.what}. {self.do}"


def advice(
    found: Survey, *, leg_rows: bool = True, presets: Mapping[str, Array] | None = None
) -> tuple[Advice, ...]:
    """All warnings about a workspace, the gravest first.

    Args:
        found: The survey.
        leg_rows: Whether the algorithm that starts knows the legs, not only the box.
        presets: Boxes (6,) of tuning presets that set one, by name.
    """
    return (
        *_unlimited(found),
        *_beyond("the tuned box", found.box, found.ranges),
        *(
            one
            for name, box in (presets or {}).items()
            for one in _beyond(f"preset {name}", box, found.ranges)
        ),
        *_head(found),
        *_corners(found, leg_rows),
        *_stranded(found),
    )


def smallest_whole(found: Survey) -> float:
    """Largest share of the box at which all 64 corners are still reachable."""
    return min(corner.scale for corner in found.corners)


def _unlimited(found: Survey) -> list[Advice]:
    names = [
        one.name for one in found.ranges if Limit.NOTHING in (one.low_end.limit, one.high_end.limit)
    ]
    if not names:
        return []
    return [
        Advice(
            f"nothing ends {', '.join(names)}",
            "Check the joints and legs.min, legs.max in the machine's file: a hexapod is always "
            "ended by something.",
        )
    ]


def _beyond(whose: str, box: Array, ranges: tuple[Range, ...]) -> list[Advice]:
    found, values = [], []
    for one in ranges:
        wanted = float(box[one.axis])
        ends = ((0, abs(one.low), one.low_end), (1, one.high, one.high_end))
        side, reach, why = min(ends, key=lambda end: end[1])
        if wanted <= reach * (1.0 + ROUNDING):
            continue
        least = amount(one.axis, reach, signed=False)
        found.append(
            f"{one.name} {amount(one.axis, wanted, signed=False)}, but {least} is all "
            f"{TOWARDS[one.axis][side]} ({why})"
        )
        values.append(f"box_{one.name}_{'m' if one.axis < 3 else 'deg'} to at most {least}")
    if not found:
        return []
    return [
        Advice(
            f"{whose} goes beyond what the axes reach alone: " + "; ".join(found),
            f"Set {', '.join(values)}: the legs cut down whatever asks for more.",
        )
    ]


def _head(found: Survey) -> list[Advice]:
    short = []
    for one in found.about_head:
        reach = min(abs(one.low), one.high)
        if found.box[one.axis] > reach * (1.0 + ROUNDING):
            short.append(
                f"{one.name} {amount(one.axis, one.low)} to {amount(one.axis, one.high)} of "
                f"+-{amount(one.axis, float(found.box[one.axis]), signed=False)}"
            )
    if not short:
        return []
    place = ", ".join(f"{value:g}" for value in np.round(found.machine.head, 3))
    return [
        Advice(
            f"about a head that stays in place at ({place}) m, less can be turned: "
            + "; ".join(short),
            "Tilting a cabin from so far below uses up its travel: expect weaker sustained "
            "forces, or give platform_joints and head from a reference point nearer to the head.",
        )
    ]


def _corners(found: Survey, leg_rows: bool) -> list[Advice]:
    count = sum(corner.scale >= 1.0 for corner in found.corners)
    if count == len(found.corners) or leg_rows:
        return []
    return [
        Advice(
            f"the algorithm keeps to the box alone, and {count} of its 64 corners are reachable",
            f"Choose mpc or thondel2014 with legs = true, or a box of {smallest_whole(found):.2f} "
            "times this one: nothing unsafe happens, but the governor cuts down every cue that "
            "leaves the legs.",
        )
    ]


def _stranded(found: Survey) -> list[Advice]:
    lost = [one for one in found.shares if one.stranded > 0.0]
    if not lost:
        return []
    said = ", ".join(
        f"{one.stranded:.1%} in "
        + ("the whole box" if one.factor == 1.0 else f"{one.factor:g} of the box")
        for one in lost
    )
    do = "Plans that would end there are refused and cut down, so nothing is unsafe"
    if found.parking is not None:
        heave, left = found.parking
        do += f"; workspace.parked.heave = {heave:g} would leave {left:.1%} in the whole box"
    return [
        Advice(
            "some reachable poses have no straight way to neutral and to the parked pose: " + said,
            f"{do}; a smaller box helps as well."
            if found.parking
            else f"{do}; a smaller box helps.",
        )
    ]
