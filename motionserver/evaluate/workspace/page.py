"""The workspace as one self-contained HTML page."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from math import degrees
from typing import Final

from motionserver import __version__
from motionserver.core.axes import AXIS_NAMES, Array
from motionserver.evaluate.html import cards, document
from motionserver.evaluate.workspace.advice import Advice, smallest_whole
from motionserver.evaluate.workspace.draw import (
    SIDE,
    corners_picture,
    picture,
    plane_picture,
    printed,
    ranges_picture,
    scales,
    units,
)
from motionserver.evaluate.workspace.draw import STYLE as PICTURE_STYLE
from motionserver.evaluate.workspace.result import Plane, Survey
from motionserver.evaluate.workspace.table import corner_counts
from motionserver.evaluate.workspace.words import corner_of, lopsided, pose_text

_STYLE: Final = """
body{max-width:1360px}
.two{display:grid;grid-template-columns:1fr 1fr;gap:0 56px}.two .ws{margin:4px 0}
.frame h3{font-size:14px;margin:0 0 6px}
.wide{padding:18px 22px}.field{grid-area:2/4/4/6;margin:0;padding:14px 16px;align-self:start}
.planes .ws{margin:2px 0}
.warn{border:1px solid var(--line);border-left:4px solid var(--c2);background:var(--card);
border-radius:10px;padding:10px 16px;margin:0 0 10px}.warn b{display:block;font-weight:600}
.planes{display:grid;grid-template-columns:repeat(5,minmax(0,1fr));gap:12px}
figure{margin:0;background:var(--card);border:1px solid var(--line);border-radius:10px;
padding:10px 12px 8px}
figcaption{display:flex;justify-content:space-between;gap:8px;font-size:13px;white-space:nowrap}
figcaption b{font-weight:600}figcaption span,figure small{color:var(--soft)}
figure small{display:block;font-size:12px;line-height:1.35;min-height:2.7em}
.key{grid-column:2/-1;grid-row:1;align-self:center;padding:0 12px 0 28px;max-width:720px}
.key .soft{font-size:13px;margin-top:10px}
.key ul{display:flex;flex-wrap:wrap;gap:6px 20px;list-style:none;margin:10px 0 0;padding:0;
font-size:13px}
.key i{display:inline-block;width:20px;height:0;border-top:3px solid;vertical-align:middle;
margin-right:7px}.key i.dash{border-top:2px dashed}
.key i.area{height:12px;border:0;background:var(--bad);opacity:.2;border-radius:2px}
.tables{display:grid;grid-template-columns:repeat(auto-fit,minmax(300px,1fr));gap:16px;
align-items:start}.tables .frame{margin:0}
@media(max-width:1100px){.planes{grid-template-columns:repeat(3,minmax(0,1fr))}
.planes figure{grid-area:auto!important}.key{grid-column:1/-1;padding:0}
.field{grid-area:auto/1/auto/-1;order:1;max-width:560px}}
@media(max-width:620px){body{padding:20px 14px 40px}
.planes{grid-template-columns:repeat(2,minmax(0,1fr));gap:8px}figure{padding:8px}
figcaption{display:block}figcaption span{display:block}.cards{gap:8px}
.card{flex-basis:130px;padding:10px 12px}.card b{font-size:22px}th,td{padding:4px 6px}
.two{grid-template-columns:minmax(0,1fr)}.wide,.field{padding:12px}.frame .ws{font-size:14px}
figure .ws{font-size:17px}}
"""
_KEY: Final = (
    ("--c1", "a leg at its longest"),
    ("--c2", "a leg at its shortest"),
    ("--c4", "a joint's angle"),
    ("--bad", "conditioning"),
)


def to_html(found: Survey, warnings: Sequence[Advice]) -> str:
    """The whole page; it needs nothing but itself."""
    machine = found.machine
    title = f"Workspace of {machine.name}"
    said = [text for one in found.ranges if (text := lopsided(one))]
    notes = "".join(f"<p>{escape(printed(text[0].upper() + text[1:]))}.</p>" for text in said)
    warned = "".join(
        f'<div class="warn"><b>{escape(printed(one.what[0].upper() + one.what[1:]))}.</b>'
        f"{escape(printed(one.do))}</div>"
        for one in warnings
    )
    sides = scales(found)
    bars = "".join(
        picture(*ranges_picture(found, axes), f"{what} alone")
        for axes, what in (((0, 1, 2), "places"), ((3, 4, 5), "attitudes"))
    )
    return document(
        title,
        PICTURE_STYLE + _STYLE,
        '<p class="soft">Straight out of neutral, to where stroke, '
        "joint angle or conditioning first ends the way. Geometry and limits "
        f"<code>{machine.digest}</code>; pitch is positive nose down. motionserver "
        f"{__version__}.</p>{_cards(found)}{warned}"
        '<h2>One axis at a time</h2><div class="frame wide"><div class="two">'
        f"{bars}</div>{notes}</div>"
        f'<h2>Two axes at a time, and all six</h2><div class="planes">{_key(found)}{_field(found)}'
        + "".join(_figure(plane, found, sides) for plane in found.planes)
        + f"</div><h2>Figures</h2>{_tables(found)}",
    )


def _cards(found: Survey) -> str:
    whole = sum(corner.scale >= 1.0 for corner in found.corners)
    half = next(one for one in found.shares if one.factor == 0.5)
    swing = found.swing
    shown = (
        (f"{whole} of 64", "corners of the tuned box reachable"),
        (
            f"\N{MULTIPLICATION SIGN} {smallest_whole(found):.2f}",
            "size of the box at which all 64 are",
        ),
        (f"{half.reachable:.0%}", "of random poses in half the box reachable"),
        (f"{half.stranded:.1%}", "of these without a straight way home"),
        (f"{found.conditioning.value:.2f}", "least sigma_min, as a share of neutral's"),
        (f"{degrees(swing.value):.1f}°", f"largest joint angle, {_allowed(swing.limit)}"),
    )
    return cards((value, text, "") for value, text in shown)


def _allowed(limit: float | None) -> str:
    return "not checked" if limit is None else f"{degrees(limit):.0f}° allowed"


def _key(found: Survey) -> str:
    lines = "".join(
        f'<li><i style="border-color:var({colour})"></i>{text}</li>' for colour, text in _KEY
    )
    sizes = ", ".join(
        f"{name} {units(axis, float(found.box[axis]))}" for axis, name in enumerate(AXIS_NAMES)
    )
    return (
        '<div class="key"><p>Shaded blue is what the machine reaches with the other four axes at '
        "neutral. The edge bears the colour of the limit that ends it; the dot marks the corner of "
        "the box that is cut off most, and how much of the way to it remains.</p><ul>"
        f'{lines}<li><i class="dash"></i>tuned box</li><li><i class="area"></i>in the box, out of '
        f'reach</li></ul><p class="soft">Box: {escape(sizes)}.</p></div>'
    )


def _field(found: Survey) -> str:
    field = picture(*corners_picture(found.corners), "corners of the box")
    return (
        '<div class="frame field"><h3>The 64 corners of the box, per cent of the way reached</h3>'
        f"{field}</div>"
    )


def _figure(plane: Plane, found: Survey, sides: Array) -> str:
    pair = [plane.first, plane.second]
    half, span = found.box[pair], sides[pair]
    first, second = AXIS_NAMES[plane.first], AXIS_NAMES[plane.second]
    where = corner_of((plane.first, plane.second), plane.worst)
    inside = plane_picture(plane, half, span)
    legs = plane.worst.ending
    worst = (
        "the whole rectangle is reachable"
        if plane.worst.scale >= 1.0
        else f"tightest {where}: {legs}"
    )
    return (
        f'<figure style="grid-area:{plane.second}/{plane.first + 1}"><figcaption>'
        f"<b>{first}, {second}</b><span>{plane.share:.0%} of box</span></figcaption>"
        f"{picture(inside, SIDE, SIDE, f'{first} and {second}')}"
        f"<small>{escape(worst)}</small></figure>"
    )


def _tables(found: Survey) -> str:
    counted = "".join(
        f"<tr><td>&times; {size:g}</td><td>{count}</td></tr>"
        for size, count in corner_counts(found.corners)
    )
    drawn = "".join(
        f"<tr><td>&times; {one.factor:g}</td><td>{one.reachable:.1%}</td><td>"
        + (f"{one.stranded:.1%}" if one.tried else "-")
        + "</td></tr>"
        for one in found.shares
    )
    places = (
        f"<tr><td>least sigma_min: {escape(printed(pose_text(found.conditioning.pose)))}</td>"
        f"<td>{found.conditioning.value:.3f}</td></tr>"
        f"<tr><td>largest joint angle, leg {found.swing.leg}: "
        f"{escape(printed(pose_text(found.swing.pose)))}</td><td>{degrees(found.swing.value):.1f}°</td></tr>"
    )
    return (
        '<div class="tables"><div class="frame"><table><thead><tr><th>size of the box</th>'
        f"<th>corners of 64</th></tr></thead><tbody>{counted}</tbody></table></div>"
        '<div class="frame"><table><thead><tr><th>random poses</th><th>reachable</th>'
        f"<th>no way home</th></tr></thead><tbody>{drawn}</tbody></table></div>"
        '<div class="frame"><table><thead><tr><th>on the edge</th><th></th></tr></thead><tbody>'
        f"{places}</tbody></table></div></div>"
    )
