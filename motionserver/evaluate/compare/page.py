"""The comparison as one page that needs nothing but itself."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Final

import numpy as np

from motionserver import __version__
from motionserver.evaluate.compare.contenders import RIVALS
from motionserver.evaluate.compare.run import Result
from motionserver.evaluate.compare.table import COLUMNS, RATIO, Block
from motionserver.evaluate.page import STYLE as PAGE_STYLE
from motionserver.evaluate.svg import STYLE as PLOT_STYLE
from motionserver.evaluate.svg import Curve, Panel, figure

_WIDE: Final = 440
_ROW: Final = 24
_LABEL: Final = 186
SHOWN: Final = 40.0
"""Curves are drawn to here [s]."""
_STYLE: Final = """
body{max-width:1320px}
h2 small{font-weight:400;color:var(--soft);font-size:13px;margin-left:8px}
.grid2{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,380px),1fr));gap:16px}
.grid2 .frame{margin:0}.frame h3{font-size:14px;margin:2px 0 6px}
.bars{display:block;width:100%;height:auto;font:13px system-ui,sans-serif}
.bars text{fill:var(--ink)}.bars .soft{fill:var(--soft);color:var(--soft)}
.bars text{paint-order:stroke;stroke:var(--card);stroke-width:4px;stroke-linejoin:round}
.bars .pale{opacity:.5}.bars .hollow{fill-opacity:.18;stroke-width:1.5}
.hollow.f1{stroke:var(--c1)}.hollow.f2{stroke:var(--c2)}.hollow.f3{stroke:var(--c3)}
.hollow.f4{stroke:var(--c4)}.hollow.f5{stroke:var(--c5)}
.key{display:flex;flex-wrap:wrap;gap:4px 18px;margin:0 0 12px;font-size:13px;color:var(--soft)}
.key span::before{content:"";display:inline-block;width:18px;height:0;margin-right:6px;
border-top:2.5px solid currentColor;vertical-align:4px}
.key .k0::before{color:var(--c0)}.key .k1::before{color:var(--c1)}
.key .k2::before{color:var(--c2)}.key .k3::before{color:var(--c3)}
.bars .one{stroke:var(--soft);stroke-dasharray:3 3}
.f0{fill:var(--c0)}.f1{fill:var(--c1)}.f2{fill:var(--c2)}.f3{fill:var(--c3)}.f4{fill:var(--c4)}
.f5{fill:var(--c5)}
.wide{padding:0}.wide table{font-size:13px}.wide th,.wide td{padding:5px 9px}
.wide td:first-child,.wide th:first-child{position:sticky;left:0;background:var(--card);
white-space:nowrap;padding-left:14px}
.wide td:last-child,.wide th:last-child{padding-right:14px}
dl{display:grid;grid-template-columns:max-content 1fr;gap:2px 14px;margin:8px 0;font-size:13px}
dt{font-weight:600}dd{margin:0;color:var(--soft)}
.notes p{font-size:13px;color:var(--soft)}
@media(max-width:600px){body{padding:20px 12px 40px}h1{font-size:22px}.card{flex-basis:130px}
.card b{font-size:22px}dl{grid-template-columns:1fr;gap:0}dd{margin-bottom:6px}
.wide td:first-child,.wide th:first-child{white-space:normal;min-width:112px;padding-left:10px}}
"""


def to_html(
    found: Sequence[Block], results: Sequence[Result], facts: str, footer: Sequence[str]
) -> str:
    """The whole page: glance, table, curves, rules."""
    title = "Cueing algorithms compared"
    bars = "".join(
        f'<div class="frame"><h3>{escape(block.title)}</h3>{_bars(block)}</div>' for block in found
    )
    legend = "".join(f"<dt>{escape(c.head)}</dt><dd>{escape(c.meaning)}</dd>" for c in COLUMNS)
    notes = "".join(f"<p>{escape(line)}</p>" for line in footer)
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<title>{title}</title><style>{PAGE_STYLE}{PLOT_STYLE}{_STYLE}</style></head><body>"
        f'<h1>{title}</h1><p class="soft">{escape(facts)} motionserver {__version__}.</p>'
        f"{_cards(found)}<h2>Error felt<small>nRMSE of f_x and f_y: 0 is perfect, 1 is standing "
        f'still</small></h2><div class="grid2">{bars}</div><h2>All figures</h2>'
        f'<div class="frame wide">{_table(found)}</div><dl>{legend}</dl>'
        f"<h2>Wanted and felt<small>the first {SHOWN:g} s of each</small></h2>{_key(results)}"
        f'<div class="grid2">{_curves(results)}</div>'
        f'<h2>Rules</h2><div class="notes">{notes}</div></body></html>\n'
    )


def _is_rival(label: str) -> bool:
    return label in RIVALS


def _colour(label: str, block: Block) -> int:
    """Rivals are quiet; each algorithm has a colour of its own, whatever its ways."""
    if _is_rival(label):
        return 0
    names = [line.label for line in block.lines if not _is_rival(line.label)]
    return 1 + list(dict.fromkeys(map(_name, names))).index(_name(label)) % 5


def _name(label: str) -> str:
    """The algorithm's name alone."""
    return label.split(" (")[0]


def _way(label: str, block: Block) -> str:
    """Full for the first way of an algorithm, hollow for the upper bound, pale between."""
    if "(told" in label:
        return "hollow"
    ways = [line.label for line in block.lines if _name(line.label) == _name(label)]
    return "" if ways[0] == label else "pale"


def _bars(block: Block) -> str:
    values = [line.values[0] for line in block.lines]
    top = max(1.15, *(1.08 * value for value in values if value is not None))
    end = _WIDE - 52
    unit = (end - _LABEL) / top
    height = _ROW * len(block.lines) + 6
    best = block.best(0)
    one = _LABEL + unit
    out = [
        f'<svg class="bars" viewBox="0 0 {_WIDE} {height}" role="img">'
        f'<path class="one" d="M{one:.1f} 2V{height - 2}"/>'
    ]
    for row, line in enumerate(block.lines):
        y, value = _ROW * row + 3, values[row]
        weight = ' font-weight="650"' if row in best else ""
        out.append(f'<text x="0" y="{y + 15}"{weight}>{escape(_short(line.label))}</text>')
        if value is None:
            out.append(f'<text class="soft" x="{_LABEL}" y="{y + 15}">nothing wanted</text>')
            continue
        wide = unit * value
        kind = f"f{_colour(line.label, block)} {_way(line.label, block)}"
        out.append(
            f'<rect class="bar {kind}" x="{_LABEL}" y="{y + 4}" rx="3" '
            f'width="{wide:.1f}" height="14"/>'
            f'<text x="{_LABEL + wide + 8:.1f}" y="{y + 15}"{weight}>{value:.3f}</text>'
        )
    return "".join(out) + "</svg>"


def _short(label: str) -> str:
    return label.replace("told ", "")


def _cards(found: Sequence[Block]) -> str:
    mean = found[0]
    column = {c.head: index for index, c in enumerate(COLUMNS)}
    broken = sum(line.values[column["broken"]] or 0.0 for line in mean.lines)
    cards = [(f"{broken:.0f}", "samples beyond a limit", "good" if broken == 0 else "poor")]
    for line in mean.lines:
        ratio = line.values[column[RATIO]]
        # all ways are in the bars below; here the first of each and the main upper bound
        bound = _way(line.label, mean) == "hollow" and _colour(line.label, mean) == 1
        plain = _way(line.label, mean) == "" and not _is_rival(line.label)
        if not (plain or bound) or ratio is None:
            continue
        kind = "good" if ratio < 1.0 else ""
        cards.append((f"{ratio:.2f}", f"{line.label}: error over hindsight, mean", kind))
    return (
        '<div class="cards">'
        + "".join(
            f'<div class="card {kind}"><b>{value}</b><span>{escape(text)}</span></div>'
            for value, text, kind in cards
        )
        + "</div>"
    )


def _table(found: Sequence[Block]) -> str:
    head = "".join(
        f'<th title="{escape(column.meaning)}">{escape(column.head)}</th>' for column in COLUMNS
    )
    out = [f"<table><thead><tr><th></th>{head}</tr></thead>"]
    wrong = next(index for index, column in enumerate(COLUMNS) if column.head == "broken")
    for block in found:
        out.append(
            f'<tbody><tr><th>{escape(block.title)}</th><th colspan="{len(COLUMNS)}"></th></tr>'
        )
        best = [block.best(index) for index in range(len(COLUMNS))]
        for row, line in enumerate(block.lines):
            cells = "".join(
                f'<td class="{_kind(index, row, line.values[index], best, wrong)}">{cell}</td>'
                for index, cell in enumerate(line.cells())
            )
            out.append(f"<tr><td>{escape(line.label)}</td>{cells}</tr>")
        out.append("</tbody>")
    return "".join(out) + "</table>"


def _kind(index: int, row: int, value: float | None, best: list[set[int]], wrong: int) -> str:
    if index == wrong and value:
        return "bad"
    return "best" if row in best[index] else ""


def _shown(results: Sequence[Result]) -> list[str]:
    """Whose curves are drawn: the first algorithm, its upper bound, the hardest rival."""
    labels = list(dict.fromkeys(result["contender"] for result in results))
    told = [label for label in labels if label.startswith(f"{_name(labels[0])} (told")]
    rival = [label for label in labels if label == "hindsight"]
    return list(dict.fromkeys([labels[0], *rival, *told[:1]]))


def _curves(results: Sequence[Result]) -> str:
    shown = _shown(results)
    out = []
    for name in dict.fromkeys(result["recording"] for result in results):
        here = [r for r in results if r["recording"] == name and r["contender"] in shown]
        if not here:
            continue
        here.sort(key=lambda r: -shown.index(r["contender"]))
        times = np.array(here[0]["curves"]["t"])
        kept = times <= SHOWN
        panels = []
        for axis, title in (("x", "f_x, forward [m/s²]"), ("y", "f_y, left [m/s²]")):
            curves = [Curve("", np.array(here[0]["curves"][f"wanted_{axis}"])[kept], 0)]
            curves += [
                Curve(
                    "",
                    np.array(r["curves"][f"felt_{axis}"])[kept],
                    1 + shown.index(r["contender"]),
                )
                for r in here
            ]
            if max(float(np.abs(curve.values).max()) for curve in curves) > 0.02:
                panels.append(Panel(title, times[kept], curves, height=170))
        drawn = figure(panels, width=_WIDE) if panels else "<p>nothing wanted</p>"
        out.append(f'<div class="frame"><h3>{escape(name)}</h3>{drawn}</div>')
    return "".join(out)


def _key(results: Sequence[Result]) -> str:
    names = ["wanted", *_shown(results)]
    return (
        '<div class="key">'
        + "".join(f'<span class="k{i}">{escape(name)}</span>' for i, name in enumerate(names))
        + "</div>"
    )
