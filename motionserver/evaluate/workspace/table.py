"""The workspace as aligned text for a terminal of 80 columns."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees
from textwrap import wrap
from typing import Final

from motionserver.evaluate.workspace.advice import Advice, smallest_whole
from motionserver.evaluate.workspace.homing import FACTORS
from motionserver.evaluate.workspace.result import Corner, Extreme, Range, Survey
from motionserver.evaluate.workspace.words import amount, corner_of, lopsided, pose_text

WIDTH: Final = 80
SIZES: Final = (0.2, 0.3, 0.4, 0.5, 1.0)
"""Sizes of the box at which reachable corners are counted."""


def to_text(found: Survey, warnings: Sequence[Advice]) -> str:
    """Ranges, planes, corners, shares, extremes and warnings, below each other."""
    lines = [
        "workspace  straight out of neutral, to the end of stroke, joint or conditioning",
        "",
        *_ranges(found),
        *_planes(found),
        *_corners(found),
        *_shares(found),
        *_extremes(found),
    ]
    for warning in warnings:
        lines += ["", *_wrapped("warning: ", str(warning))]
    return "\n".join(line.rstrip() for line in lines)


def corner_counts(corners: Sequence[Corner]) -> list[tuple[float, int]]:
    """How many corners are reachable at each of the `SIZES` of their box."""
    return [(size, sum(corner.scale >= size for corner in corners)) for size in SIZES]


def _ranges(found: Survey) -> list[str]:
    lines = [f"  {'axis':<6}{'from':>11}  {'ended by':<18}  {'to':>11}  {'ended by':<18}{'box':>8}"]
    lines += [_range(one, one.name, found) for one in found.ranges]
    if found.about_head:
        lines += ["", "  the same about a head that stays in place"]
        lines += [_range(one, one.name, found) for one in found.about_head]
    said = [text for one in found.ranges if (text := lopsided(one))]
    if said:
        lines.append("")
        lines += [line for text in said for line in _wrapped("  ", text)]
    return lines


def _range(one: Range, name: str, found: Survey) -> str:
    box = float(found.box[one.axis])
    return (
        f"  {name:<6}{amount(one.axis, one.low):>11}  {_short(one.low_end):<18}"
        f"  {amount(one.axis, one.high):>11}  {_short(one.high_end):<18}"
        f"{(f'{box:.3f}' if one.axis < 3 else f'{degrees(box):.2f}'):>8}"
    )


def _short(ending: object) -> str:
    text = str(ending)
    for word, brief in (("longest", "long"), ("shortest", "short"), (", ", " ")):
        text = text.replace(word, brief)
    return text.replace("legs 1 2 3 4 5 6", "all legs")


def _planes(found: Survey) -> list[str]:
    lines = [
        "",
        "  in the plane of  of the box  worst corner of the box          reached there",
    ]
    for plane in found.planes:
        where = corner_of((plane.first, plane.second), plane.worst)
        lines.append(
            f"  {plane.name:<17}{plane.share:>8.0%}    {where:<33}{plane.worst.scale:>4.0%}  "
            f"{_brief(plane.worst)}"
        )
    return lines


def _brief(corner: Corner) -> str:
    legs = " ".join(map(str, corner.ending.legs))
    return f"leg {legs}" if legs else str(corner.ending.limit)


def _corners(found: Survey) -> list[str]:
    sizes = "".join(f"{f'x {size:g}':>7}" for size in SIZES)
    lines = ["", f"  corners reached, of 64{sizes} all up to  any up to"]
    rows = [("tuned box", found.corners)]
    if found.machine_corners != found.corners:
        rows.append(("machine's box", found.machine_corners))
    for name, corners in rows:
        counts = "".join(f"{count:>7}" for _, count in corner_counts(corners))
        scales = [corner.scale for corner in corners]
        lines.append(f"    {name:<20}{counts}{min(scales):>10.2f}{max(scales):>11.2f}")
    return lines


def _shares(found: Survey) -> list[str]:
    head = "".join(f"{f'x {factor:g}':>7}" for factor in FACTORS)
    reached = "".join(f"{one.reachable:>7.1%}" for one in found.shares)
    lost = "".join(f"{one.stranded:>7.1%}" if one.tried else "      -" for one in found.shares)
    return [
        "",
        f"  {'random poses of the tuned box':<44}{head}",
        f"    {'reachable':<42}{reached}",
        f"    {'of these without a straight way home':<42}{lost}",
    ]


def _extremes(found: Survey) -> list[str]:
    steady, swing = found.conditioning, found.swing
    limit = "not checked" if swing.limit is None else f"{degrees(swing.limit):.1f} deg allowed"
    least = "not checked" if steady.limit is None else f"at least {steady.limit:g}"
    lines = [
        "",
        "  on the edge of all this",
        f"    least sigma_min          {steady.value:.3f} of neutral's, {least}",
        f"    largest joint angle      {degrees(swing.value):.1f} deg, {limit}, leg {swing.leg}",
    ]
    for one in (_where("sigma_min", steady), _where("joint angle", swing)):
        lines += _wrapped("    ", one)
    lines += _wrapped(
        "  ",
        f"all corners of the tuned box are reachable at {smallest_whole(found):.2f} of its size: "
        "the box bounds each axis, the legs decide together",
    )
    return lines


def _where(name: str, extreme: Extreme) -> str:
    return f"{name} at {pose_text(extreme.pose)}"


def _wrapped(lead: str, text: str) -> list[str]:
    indent = " " * len(lead)
    return wrap(text, WIDTH, initial_indent=lead, subsequent_indent=indent, break_long_words=False)
