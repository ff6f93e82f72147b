"""Small pictures of the workspace as SVG: a plane, the six ranges, the 64 corners."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from html import escape
from math import degrees
from typing import Final

import numpy as np

from motionserver.core.axes import AXIS_NAMES, Array
from motionserver.core.kinematics.reach import Ending, Limit
from motionserver.evaluate.workspace.result import Corner, Plane, Survey
from motionserver.evaluate.workspace.words import TOWARDS, amount, corner_of

SIDE: Final = 240
"""Width and height of a plane's picture [px]."""
_MARGIN: Final = 34
_ROOM: Final = 1.02

LIMIT_CLASS: Final = {
    Limit.LONGEST: "long",
    Limit.SHORTEST: "short",
    Limit.JOINT: "joint",
    Limit.CONDITIONING: "cond",
    Limit.NOTHING: "open",
}
"""Class of a line that a limit draws."""

STYLE: Final = """
.ws{display:block;width:100%;height:auto;font:12px system-ui,-apple-system,"Segoe UI",sans-serif}
.ws text{fill:var(--soft,#667085);paint-order:stroke;stroke:var(--card,#fff);stroke-width:3px;
stroke-linejoin:round}
.ws .name{fill:var(--ink,#1d2430);font-weight:600} .ws .plain{stroke:none}
.ws .axis{stroke:var(--line,#d9dde3)} .ws .lost{fill:var(--bad,#c8372d);opacity:.11}
.ws .region{fill:var(--card,#fff)} .ws .tint{fill:var(--c1,#2563c9);opacity:.11}
.ws .box{fill:none;stroke:var(--ink,#1d2430);stroke-width:1.1;stroke-dasharray:4 3;opacity:.75}
.ws .edge{fill:none;stroke-width:2.2;stroke-linecap:round}
.ws .long{stroke:var(--c1,#2563c9)} .ws .short{stroke:var(--c2,#d9730d)}
.ws .joint{stroke:var(--c4,#8b4fc4)} .ws .cond{stroke:var(--bad,#c8372d)}
.ws .open{stroke:var(--soft,#889)}
.ws .worst{fill:var(--bad,#c8372d)} .ws .lead{stroke:var(--bad,#c8372d);stroke-width:1}
.ws .note{fill:var(--bad,#c8372d);font-weight:650}
.ws .bar{fill:var(--c1,#2563c9);opacity:.16} .ws .cell{fill:var(--c1,#2563c9)}
"""
"""Style of all pictures; a page may set the variables."""


def scales(found: Survey) -> Array:
    """Half width of each axis in all its planes, (6,): one axis, one scale."""
    out: Array = found.box.copy()
    for plane in found.planes:
        pair = [plane.first, plane.second]
        out[pair] = np.maximum(out[pair], np.abs(plane.edge).max(0))
    return out * _ROOM


def plane_picture(plane: Plane, half: Array, span: Array) -> str:
    """One plane: the reachable part, coloured along its edge by what ends it, and the box.

    Args:
        plane: What was found.
        half: Half sides of the box in this plane, (2,) [m or rad].
        span: Half sides of the picture, (2,), see `scales`.

    Returns:
        The inside of an SVG of `SIDE` by `SIDE`.
    """
    middle, inner = SIDE / 2, SIDE / 2 - _MARGIN / 2

    def at(point: Array) -> tuple[float, float]:
        return (
            middle + float(point[0] / span[0]) * inner,
            middle - float(point[1] / span[1]) * inner,
        )

    points = [at(point) for point in plane.edge]
    outline = "L".join(f"{x:.1f} {y:.1f}" for x, y in points)
    left, top = at(np.array([-half[0], half[1]]))
    width, height = 2 * (middle - left), 2 * (middle - top)
    rectangle = f'x="{left:.1f}" y="{top:.1f}" width="{width:.1f}" height="{height:.1f}"'
    stop, low = SIDE - _MARGIN / 2, _MARGIN / 2
    out = [
        f'<path class="axis" d="M{low} {middle}H{stop}M{middle} {low}V{stop}"/>',
        f'<rect class="lost" {rectangle}/>',
        f'<path class="region" d="M{outline}Z"/><path class="tint" d="M{outline}Z"/>',
        f'<path class="axis" d="M{low} {middle}H{stop}M{middle} {low}V{stop}"/>',
        f'<rect class="box" {rectangle}/>',
        *_edge(points, plane.endings),
        *_axis_words(plane, middle, low, stop),
        _worst(plane, half, at),
    ]
    return "".join(out)


def _edge(points: Sequence[tuple[float, float]], ends: Sequence[Ending]) -> list[str]:
    """The boundary in runs of one limit; each piece belongs to the limit of its first point."""
    out, count = [], len(points)
    start = next((i for i in range(count) if ends[i].limit != ends[i - 1].limit), 0)
    run = [points[start]]
    for step in range(1, count + 1):
        now, before = (start + step) % count, (start + step - 1) % count
        run.append(points[now])
        if step == count or ends[now].limit != ends[before].limit:
            path = "L".join(f"{x:.1f} {y:.1f}" for x, y in run)
            out.append(f'<path class="edge {LIMIT_CLASS[ends[before].limit]}" d="M{path}"/>')
            run = [points[now]]
    return out


def _axis_words(plane: Plane, middle: float, low: float, stop: float) -> list[str]:
    right, up = TOWARDS[plane.first][1], TOWARDS[plane.second][1]
    return [
        f'<text x="{stop}" y="{SIDE - 3}" text-anchor="end">{right} \N{RIGHTWARDS ARROW}</text>',
        f'<text x="{middle}" y="{low - 5}" text-anchor="middle">\N{UPWARDS ARROW} {up}</text>',
    ]


def _worst(plane: Plane, half: Array, at: Callable[[Array], tuple[float, float]]) -> str:
    if plane.worst.scale >= 1.0:
        return ""
    corner = np.array(plane.worst.signs) * half
    x, y = at(plane.worst.scale * corner)
    end_x, end_y = at(corner)
    tip = f"{plane.worst.scale:.0%}"
    beside = 9 if plane.worst.signs[0] < 0 else -9
    anchor = "start" if beside > 0 else "end"
    where = corner_of((plane.first, plane.second), plane.worst)
    return (
        f"<g><title>{escape(where)}: {tip} of the way, {escape(str(plane.worst.ending))}</title>"
        f'<path class="lead" d="M{x:.1f} {y:.1f}L{end_x:.1f} {end_y:.1f}"/>'
        f'<circle class="worst" cx="{x:.1f}" cy="{y:.1f}" r="3.4"/>'
        f'<text class="note" x="{x + beside:.1f}" y="{y + 4:.1f}" text-anchor="{anchor}">{tip}'
        "</text></g>"
    )


def picture(inside: str, width: int, height: int, label: str) -> str:
    """Wrap the inside of a picture for a page."""
    return (
        f'<svg class="ws" viewBox="0 0 {width} {height}" role="img" '
        f'aria-label="{escape(label)}">{inside}</svg>'
    )


def ranges_picture(found: Survey, axes: Sequence[int]) -> tuple[str, int, int]:
    """Some axes alone, each to its own scale, the box dashed: inside, width and height."""
    width, row, middle = 440, 58, 220.0
    out = []
    for number, one in enumerate(found.ranges[axis] for axis in axes):
        y = number * row + 14
        box = float(found.box[one.axis])
        span = max(abs(one.low), one.high, box) / (middle - 2.0)
        low, high = middle + one.low / span, middle + one.high / span
        out.append(
            f'<text class="name" x="{middle}" y="{y}" text-anchor="middle">{one.name}</text>'
            f'<path class="axis" d="M{middle} {y + 6}v26"/>'
            f'<rect class="bar" x="{low:.1f}" y="{y + 9}" width="{high - low:.1f}" height="20"/>'
        )
        for side, x, end in ((0, low, one.low_end), (1, high, one.high_end)):
            value = printed(amount(one.axis, (one.low, one.high)[side]))
            place = ('x="0"', f'x="{width}" text-anchor="end"')[side]
            out.append(
                f"<g><title>{escape(TOWARDS[one.axis][side])}: {escape(str(end))}</title>"
                f'<path class="edge {LIMIT_CLASS[end.limit]}" d="M{x:.1f} {y + 9}v20"/>'
                f'<text {place} y="{y}"><tspan class="name">{value}</tspan> '
                f"{escape(_legs(end))}</text></g>"
            )
        for sign in (-1, 1):
            x = middle + sign * box / span
            out.append(f'<path class="box" d="M{x:.1f} {y + 6}v26"/>')
    return "".join(out), width, len(axes) * row - 10


def printed(text: str) -> str:
    """Numbers as a page prints them: a true minus, a true plus-minus, degrees as a sign."""
    text = text.replace("+-", "\N{PLUS-MINUS SIGN}")
    text = re.sub(r"(?<![\w.])-(?=\d)", "\N{MINUS SIGN}", text)
    return re.sub(r"(?<=\d) deg\b", "\N{DEGREE SIGN}", text)


def _legs(ending: Ending) -> str:
    if not ending.legs:
        return str(ending.limit)
    return "all legs" if len(ending.legs) == 6 else f"leg {' '.join(map(str, ending.legs))}"


def corners_picture(corners: Sequence[Corner]) -> tuple[str, int, int]:
    """The 64 corners as an 8 by 8 field, darker where more of the way is reachable.

    Columns are the places (surge, sway, heave), rows the attitudes (roll, pitch, yaw).
    """
    size, left, top = 46, 52, 48
    out = []
    signs = [(a, b, c) for a in (1, -1) for b in (1, -1) for c in (1, -1)]
    for number, triple in enumerate(signs):
        marks = "".join("+" if sign > 0 else "\N{MINUS SIGN}" for sign in triple)
        centre = left + (number + 0.5) * size
        down = top + (number + 0.5) * size + 4
        out.append(f'<text x="{centre}" y="{top - 7}" text-anchor="middle">{marks}</text>')
        out.append(f'<text x="{left - 8}" y="{down}" text-anchor="end">{marks}</text>')
    out.append('<text x="0" y="13">across: surge, sway, heave; down: roll, pitch, yaw</text>')
    for corner in corners:
        column, row = signs.index(corner.signs[:3]), signs.index(corner.signs[3:])  # type: ignore[arg-type]
        x, y = left + column * size, top + row * size
        share = min(corner.scale, 1.0)
        words = ", ".join(TOWARDS[axis][sign > 0] for axis, sign in enumerate(corner.signs))
        out.append(
            f"<g><title>{escape(words)}: {share:.0%} of the way, {escape(str(corner.ending))}"
            f'</title><rect class="cell" x="{x + 1}" y="{y + 1}" width="{size - 2}" '
            f'height="{size - 2}" rx="4" opacity="{0.06 + 0.6 * share**1.3:.3f}"/>'
            f'<text class="name plain" x="{x + size / 2}" y="{y + size / 2 + 4}" '
            f'text-anchor="middle">{100 * share:.0f}</text></g>'
        )
    return "".join(out), left + 8 * size, top + 8 * size


def units(axis: int, value: float) -> str:
    """A half side of the box for a caption."""
    return f"±{value:.3f} m" if axis < 3 else f"±{degrees(value):.1f}°"


def planes_file(found: Survey) -> str:
    """All planes as one SVG file of its own, a triangle of pictures that share their axes."""
    step, sides = SIDE + 22, scales(found)
    width, height = 5 * step, 5 * step
    out = [
        f'<svg class="ws" xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
        f'role="img"><title>Workspace of {escape(found.machine.name)}</title>'
        f"<style>{STYLE}</style>"
        f'<rect width="{width}" height="{height}" fill="#fff"/>'
    ]
    for plane in found.planes:
        half = found.box[[plane.first, plane.second]]
        x, y = plane.first * step + 11, (plane.second - 1) * step + 16
        names = f"{AXIS_NAMES[plane.first]}, {AXIS_NAMES[plane.second]}"
        out.append(
            f'<g transform="translate({x} {y})"><text class="name" x="12" y="4">{names}</text>'
            f"{plane_picture(plane, half, sides[[plane.first, plane.second]])}</g>"
        )
    return "".join(out) + "</svg>\n"
