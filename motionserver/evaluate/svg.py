"""Line plots as plain SVG text: no library, no assets, colours from the page's style sheet."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import Final

import numpy as np

from motionserver.core.axes import Array

WIDTH: Final = 920
_LEFT, _RIGHT, _TOP, _BOTTOM = 62, 14, 30, 24
_MOST_POINTS: Final = 1400

STYLE: Final = """
.plot{display:block;width:100%;height:auto;font:12px system-ui,sans-serif}
.plot text{fill:var(--soft,#667)} .plot .head{fill:var(--ink,#223);font-weight:600}
.plot .grid{stroke:var(--line,#d5d9e0);stroke-width:1} .plot .zero{stroke:var(--soft,#889)}
.plot .curve{fill:none;stroke-width:1.5;stroke-linejoin:round}
.plot .limit{stroke:var(--bad,#c33);stroke-width:1.2;stroke-dasharray:5 4}
.plot .span{fill:var(--bad,#c33);opacity:.13}
.c0{stroke:var(--c0,#7b8494)} .c1{stroke:var(--c1,#2563c9)} .c2{stroke:var(--c2,#d9730d)}
.c3{stroke:var(--c3,#159a6b)} .c4{stroke:var(--c4,#8b4fc4)} .c5{stroke:var(--c5,#c2417c)}
"""
"""Style of all plots; the page may set the variables."""


@dataclass(frozen=True, slots=True)
class Curve:
    """One line.

    Attributes:
        label: For the legend; empty for none.
        values: (N,).
        colour: 0..5; 0 is the quiet one for what is wanted.
    """

    label: str
    values: Array
    colour: int


@dataclass(frozen=True, slots=True)
class Panel:
    """One plot over time.

    Attributes:
        title: With the unit.
        times: (N,) [s], common to all curves.
        curves: Lines, the last on top.
        limits: Dashed levels.
        spans: Highlighted intervals (begin, end) [s].
        height: Of the plot [px].
        bounds: Vertical range; from the curves if None.
    """

    title: str
    times: Array
    curves: Sequence[Curve]
    limits: Sequence[float] = ()
    spans: Sequence[tuple[float, float]] = ()
    height: int = 190
    bounds: tuple[float, float] | None = None


def figure(panels: Sequence[Panel], standalone: bool = False, width: int = WIDTH) -> str:
    """Draw panels below each other.

    Args:
        panels: At least one.
        standalone: True for a file of its own: with name space and style.
        width: Of its own coordinates [px]; letters look larger on the page when it is less.

    Returns:
        An ``<svg>`` element.
    """
    height = sum(panel.height for panel in panels)
    head = f'<svg class="plot" viewBox="0 0 {width} {height}" role="img"'
    parts = [head + (' xmlns="http://www.w3.org/2000/svg">' if standalone else ">")]
    if standalone:
        parts.append(f"<style>{STYLE}</style>")
        parts.append(f'<rect width="{width}" height="{height}" fill="#fff"/>')
    top = 0
    for panel in panels:
        parts.append(f'<g transform="translate(0 {top})">{_panel(panel, width)}</g>')
        top += panel.height
    return "".join(parts) + "</svg>"


def spans_where(times: Array, mask: Array) -> list[tuple[float, float]]:
    """Intervals in which ``mask`` (N,) holds."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(int)))
    last = len(times) - 1
    return [
        (float(times[a]), float(times[min(int(b), last)]))
        for a, b in zip(edges[::2], edges[1::2], strict=True)
    ]


def _panel(panel: Panel, width: int) -> str:
    low, high = panel.bounds or _range(panel)
    begin, end = float(panel.times[0]), float(panel.times[-1])
    right, bottom = width - _RIGHT, panel.height - _BOTTOM

    def x(time: float) -> float:
        return _LEFT + (time - begin) / max(end - begin, 1e-9) * (right - _LEFT)

    def y(value: float) -> float:
        return bottom - (value - low) / (high - low) * (bottom - _TOP)

    out = [f'<text class="head" x="{_LEFT}" y="18">{escape(panel.title)}</text>']
    for a, b in panel.spans:
        wide = max(x(b) - x(a), 1.0)
        out.append(
            f'<rect class="span" x="{x(a):.1f}" y="{_TOP}" width="{wide:.1f}" '
            f'height="{bottom - _TOP}"/>'
        )
    for value in _ticks(low, high, 5):
        zero = " zero" if abs(value) < 1e-12 else ""
        out.append(
            f'<path class="grid{zero}" d="M{_LEFT} {y(value):.1f}H{right}"/>'
            f'<text x="{_LEFT - 6}" y="{y(value) + 4:.1f}" text-anchor="end">{value:.6g}</text>'
        )
    out += [
        f'<text x="{x(time):.1f}" y="{bottom + 16}" text-anchor="middle">{time:g}'
        f"{' s' if time >= end - 1e-9 else ''}</text>"
        for time in _ticks(begin, end, 10 if width > 600 else 5)
    ]
    out += [
        f'<path class="limit" d="M{_LEFT} {y(level):.1f}H{right}"/>'
        for level in panel.limits
        if low <= level <= high
    ]
    for curve in panel.curves:
        points = _thin(panel.times, np.clip(curve.values, low - 1.0, high + 1.0))
        path = "L".join(f"{x(t):.1f} {min(max(y(v), 0), panel.height):.1f}" for t, v in points)
        out.append(f'<path class="curve c{curve.colour}" d="M{path}"/>')
    return "".join(out) + _legend(panel.curves, right)


def _legend(curves: Sequence[Curve], right: int) -> str:
    out, at = [], float(right)
    for curve in reversed([c for c in curves if c.label]):
        width = 7.0 * len(curve.label)
        at -= width
        out.append(f'<text x="{at:.0f}" y="18">{escape(curve.label)}</text>')
        out.append(f'<path class="curve c{curve.colour}" d="M{at - 22:.0f} 14h17"/>')
        at -= 36.0
    return "".join(out)


def _range(panel: Panel) -> tuple[float, float]:
    values = [float(f(curve.values)) for curve in panel.curves for f in (np.nanmin, np.nanmax)]
    low, high = min([*values, *panel.limits]), max([*values, *panel.limits])
    if high - low < 1e-9:
        low, high = low - 1.0, high + 1.0
    room = 0.06 * (high - low)
    return low - room, high + room


def _ticks(low: float, high: float, about: int) -> list[float]:
    raw = (high - low) / about
    power = 10.0 ** np.floor(np.log10(raw))
    step = next(float(power * m) for m in (1.0, 2.0, 2.5, 5.0, 10.0) if power * m >= raw * 0.999)
    first = int(np.ceil(low / step - 1e-9))
    last = int(np.floor(high / step + 1e-9))
    return [k * step for k in range(first, last + 1)]


def _thin(times: Array, values: Array) -> list[tuple[float, float]]:
    """Keep the lowest and the highest sample of each pixel's worth, so that no peak is lost."""
    count = len(values)
    if count <= _MOST_POINTS:
        return list(zip(times.tolist(), values.tolist(), strict=True))
    edges = np.linspace(0, count, _MOST_POINTS // 2 + 1).astype(int)
    kept: list[int] = []
    for a, b in itertools.pairwise(edges):
        piece = values[a:b]
        kept += sorted({int(a + np.argmin(piece)), int(a + np.argmax(piece))})
    return [(float(times[i]), float(values[i])) for i in kept]
