"""Gain and phase over frequency, all algorithms side by side, one page."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from math import log10
from typing import Final

from motionserver import __version__
from motionserver.evaluate.html import document
from motionserver.evaluate.omct.boundaries import Boundaries, Boundary
from motionserver.evaluate.omct.report import of_test, outside
from motionserver.evaluate.omct.run import Omct, Response
from motionserver.evaluate.omct.sines import TESTS, Test

_WIDTH: Final = 440
_LEFT: Final = 44
_HEIGHT: Final = 150
_STYLE: Final = """
body{max-width:1320px}
.grid2{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,380px),1fr));gap:16px}
.grid2 .frame{margin:0}.frame h3{font-size:14px;margin:2px 0 6px}
.bode{display:block;width:100%;height:auto;font:12px system-ui,sans-serif}
.bode text{fill:var(--soft)}.bode .line{stroke:var(--line)}.bode .perfect{stroke:var(--soft)}
.bode .curve{fill:none;stroke-width:2;stroke-linejoin:round}
.bode .bound{fill:none;stroke:var(--bad);stroke-dasharray:5 4}
.key{display:flex;flex-wrap:wrap;gap:4px 18px;margin:8px 0 14px;font-size:14px}
.key span::before{content:"";display:inline-block;width:18px;margin-right:6px;
border-top:3px solid currentColor;vertical-align:4px}
.s1{stroke:var(--c1)}.s2{stroke:var(--c2)}.s3{stroke:var(--c3)}.s4{stroke:var(--c4)}
.s5{stroke:var(--c5)}.d1{fill:var(--c1)}.d2{fill:var(--c2)}.d3{fill:var(--c3)}.d4{fill:var(--c4)}
.d5{fill:var(--c5)}.k1::before{color:var(--c1)}.k2::before{color:var(--c2)}
.k3::before{color:var(--c3)}.k4::before{color:var(--c4)}.k5::before{color:var(--c5)}
.late{font-size:13px;color:var(--soft);margin:4px 0 0}details{margin-top:8px;font-size:13px}
summary{cursor:pointer;color:var(--soft)}details table{font-size:12px}th,td{padding:3px 8px}
.notes p{font-size:13px;color:var(--soft)}
@media(max-width:600px){body{padding:20px 12px 40px}h1{font-size:22px}}
"""


def to_html(found: Omct, boundaries: Boundaries | None, facts: str, notes: Sequence[str]) -> str:
    """The whole page; it needs nothing but itself."""
    names = list(dict.fromkeys(response.algorithm for response in found.responses))
    key = "".join(
        f'<span class="k{1 + i % 5}">{escape(name)}</span>' for i, name in enumerate(names)
    )
    cards = "".join(_card(test, of_test(found, test.number), boundaries) for test in TESTS)
    rules = "".join(f"<p>{escape(note)}.</p>" for note in notes)
    return document(
        "Objective motion cueing test",
        _STYLE,
        f'<p class="soft">{escape(facts)} motionserver {__version__}.</p>'
        f'<div class="key">{key}</div><div class="grid2">{cards}</div>'
        f'<h2>How to read it</h2><div class="notes">{rules}</div>',
    )


def _card(test: Test, responses: list[Response], boundaries: Boundaries | None) -> str:
    boundary = None if boundaries is None else boundaries.tests.get(test.number)
    late = ""
    if test.direct:
        times = ", ".join(f"{escape(r.algorithm)} {1e3 * r.delay:.0f} ms" for r in responses)
        top = responses[0].points[-1].omega
        late = f'<p class="late">late at {top:g} rad/s: {times}</p>'
    return (
        f'<div class="frame"><h3>{test.number}. {escape(test.title)}</h3>'
        f"{_bode(responses, boundary)}{late}{_table(responses, boundaries)}</div>"
    )


def _bode(responses: list[Response], boundary: Boundary | None) -> str:
    omegas = [point.omega for point in responses[0].points]
    gains = [p.gain for r in responses for p in r.points]
    phases = [p.phase for r in responses for p in r.points]
    if boundary is not None:
        gains += _flat(boundary, "gain_low", "gain_high")
        phases += _flat(boundary, "phase_low_deg", "phase_high_deg")
    high = max(1.2, 1.05 * min(max(gains), 5.0))
    low_phase, high_phase = min(-90.0, *phases), max(30.0, *phases)
    step = 45.0 if high_phase - low_phase <= 270.0 else 90.0
    step = step if high_phase - low_phase <= 540.0 else 180.0
    ticks = [
        step * k for k in range(int(-2000 / step), int(2000 / step))
        if low_phase <= step * k <= high_phase
    ]  # fmt: skip
    levels = [0.0, 0.5, 1.0] if high < 2.5 else [float(k) for k in range(int(high) + 1)]
    parts = [
        f'<svg class="bode" viewBox="0 0 {_WIDTH} {2 * _HEIGHT + 24}" role="img">',
        _panel("gain", omegas, responses, boundary, (0.0, high), levels, 1.0, 0),
        _panel("phase", omegas, responses, boundary, (low_phase, high_phase), ticks, 0.0, _HEIGHT),
    ]
    for omega in (0.1, 1.0, 10.0):
        if omegas[0] * 0.99 <= omega <= omegas[-1] * 1.01:
            x = _across(omega, omegas)
            parts.append(
                f'<text x="{x:.1f}" y="{2 * _HEIGHT + 16}" text-anchor="middle">{omega:g}</text>'
            )
    parts.append(
        f'<text x="{_WIDTH - 6}" y="{2 * _HEIGHT + 16}" text-anchor="end">rad/s</text></svg>'
    )
    return "".join(parts)


def _panel(
    kind: str,
    omegas: list[float],
    responses: list[Response],
    boundary: Boundary | None,
    span: tuple[float, float],
    ticks: list[float],
    perfect: float,
    top: int,
) -> str:
    def y(value: float) -> float:
        share = (min(max(value, span[0]), span[1]) - span[0]) / (span[1] - span[0])
        return top + _HEIGHT - 8 - share * (_HEIGHT - 30)

    unit = "" if kind == "gain" else " [deg]"
    out = [f'<text x="{_LEFT}" y="{top + 12}">{kind}{unit}</text>']
    for tick in ticks:
        style = "perfect" if tick == perfect else "line"
        out.append(
            f'<path class="{style}" d="M{_LEFT} {y(tick):.1f}H{_WIDTH - 8}"/>'
            f'<text x="{_LEFT - 6}" y="{y(tick) + 4:.1f}" text-anchor="end">{tick:g}</text>'
        )
    names = ("gain_low", "gain_high") if kind == "gain" else ("phase_low_deg", "phase_high_deg")
    for name in names if boundary is not None else ():
        assert boundary is not None
        pairs = [(w, v) for w in omegas if (v := boundary.at(name, w)) is not None]
        if pairs:
            path = "L".join(f"{_across(w, omegas):.1f} {y(v):.1f}" for w, v in pairs)
            out.append(f'<path class="bound" d="M{path}"/>')
    for index, response in enumerate(responses):
        places = [
            (_across(p.omega, omegas), y(p.gain if kind == "gain" else p.phase))
            for p in response.points
        ]
        path = "L".join(f"{a:.1f} {b:.1f}" for a, b in places)
        out.append(f'<path class="curve s{1 + index % 5}" d="M{path}"/>')
        out += [f'<circle class="d{1 + index % 5}" cx="{a:.1f}" cy="{b:.1f}" r="3"/>'
                for a, b in places]  # fmt: skip
    return "".join(out)


def _flat(boundary: Boundary, *names: str) -> list[float]:
    return [float(v) for name in names for v in boundary.lists.get(name, ())]


def _across(omega: float, omegas: list[float]) -> float:
    span = max(log10(omegas[-1] / omegas[0]), 1e-9)
    return _LEFT + 6 + log10(omega / omegas[0]) / span * (_WIDTH - _LEFT - 22)


def _table(responses: list[Response], boundaries: Boundaries | None) -> str:
    head = "".join(f'<th colspan="2">{escape(r.algorithm)}</th>' for r in responses)
    out = [f"<details><summary>numbers</summary><table><tr><th>rad/s</th>{head}</tr>"]
    beyond = {(r.algorithm, p.omega) for r in responses for p in outside(r, boundaries)}
    for row, first in enumerate(responses[0].points):
        cells = ""
        for response in responses:
            point = response.points[row]
            kind = ' class="bad"' if (response.algorithm, point.omega) in beyond else ""
            cells += f"<td{kind}>{point.gain:.3f}</td><td{kind}>{point.phase:.0f}°</td>"
        out.append(f"<tr><td>{first.omega:g}</td>{cells}</tr>")
    return "".join(out) + "</table></details>"
