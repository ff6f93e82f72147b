"""The report as one self-contained HTML page with inline plots."""

from __future__ import annotations

from html import escape
from math import degrees

import numpy as np

from motionserver import __version__
from motionserver.core.axes import Array, Axis
from motionserver.evaluate.drive import Drive
from motionserver.evaluate.hindsight import HINDSIGHT_RULE
from motionserver.evaluate.html import STYLE, cards, document
from motionserver.evaluate.metrics.comfort import tilt_rate
from motionserver.evaluate.report import remarks
from motionserver.evaluate.result import EvaluateResult
from motionserver.evaluate.rows import sections
from motionserver.evaluate.svg import STYLE as PLOT_STYLE
from motionserver.evaluate.svg import Curve, Panel, figure
from motionserver.evaluate.yardstick import RULE

__all__ = ["STYLE", "to_html"]


def to_html(result: EvaluateResult) -> str:
    """The whole page; it needs nothing but itself."""
    recording, machine = result.recording, result.machine
    title = f"{recording.name}: felt against wanted"
    facts = (
        f"{recording.duration:.1f} s at scale {result.tuning.scale:g} on {machine.name} "
        f"<code>{machine.digest}</code>, planner {result.planner_hz:g} Hz, judged on executed "
        f"samples at {result.rate:g} Hz. motionserver {__version__}."
    )
    plots = "".join(
        f'<h2>{escape(name)}</h2><div class="frame">{figure(panels)}</div>'
        for name, panels in _plots(result)
    )
    notes = "".join(f"<p>{escape(line)}.</p>" for line in remarks(result))
    return document(
        title,
        PLOT_STYLE,
        f'<p class="soft">{facts}</p>{_cards(result)}{notes}'
        f'<p class="soft">Yardstick: {escape(RULE)}. Its gain here: '
        f"{result.yardstick.gain:g}.</p>"
        f'<p class="soft">Hindsight: {escape(HINDSIGHT_RULE)}. Here: '
        f"{escape(result.hindsight.described())}.</p>{plots}<h2>All figures</h2>"
        f'<div class="frame">{_table(result)}</div>',
    )


def _cards(result: EvaluateResult) -> str:
    still = result.of("no motion").rmse_xy
    shown = [
        (
            f"{result.violations}",
            "samples beyond a limit",
            "good" if result.violations == 0 else "poor",
        )
    ]
    for figures in result.figures:
        if figures.name == "no motion":
            shown.append((f"{figures.rmse_xy:.3f}", "RMSE(x, y) of no motion [m/s²]", ""))
        else:
            name = (
                figures.name
                if figures.name != "yardstick"
                else (f"yardstick (gain {result.yardstick.gain:g})")
            )
            won = 100.0 * (1.0 - figures.rmse_xy / still) if still > 0.0 else 0.0
            shown.append(
                (
                    f"{figures.rmse_xy:.3f}",
                    f"RMSE(x, y) of {name}: {won:+.0f} % felt error saved",
                    "",
                )
            )
    return cards(shown)


def _table(result: EvaluateResult) -> str:
    names = [figures.name for figures in result.figures]
    head = "".join(f"<th>{escape(name)}</th>" for name in names)
    out = [f"<table><thead><tr><th></th>{head}</tr></thead>"]
    for section in sections(result):
        out.append(f'<tbody><tr><th colspan="{len(names) + 1}">{escape(section.title)}</th></tr>')
        for row in section.rows:
            cells = "".join(
                f'<td class="{"bad" if i in row.bad else "best" if i in row.best else ""}">'
                f"{escape(cell)}</td>"
                for i, cell in enumerate(row.cells)
            )
            out.append(f"<tr><td>{escape(row.label)}</td>{cells}</tr>")
        out.append("</tbody>")
    return "".join(out) + "</table>"


def _plots(result: EvaluateResult) -> list[tuple[str, list[Panel]]]:
    movers = [drive for drive in result.drives if drive.name not in ("no motion", "hindsight")]
    out = [
        ("Specific force at the head", _force_panels(movers)),
        ("Body rates", _rate_panels(movers)),
    ]
    out += [(f"Platform under {drive.name}", _platform_panels(drive)) for drive in movers]
    return out


def _moves(curves: list[Curve]) -> bool:
    """Whether there is anything to see."""
    return any(float(np.max(np.abs(curve.values))) > 1e-6 for curve in curves)


def _beside(movers: list[Drive], values: list[Array]) -> list[Curve]:
    """One curve of every drive, each with its colour, the first on top."""
    curves = [
        Curve(drive.name, each, 1 + i % 5)
        for i, (drive, each) in enumerate(zip(movers, values, strict=True))
    ]
    return curves[::-1]


def _force_panels(movers: list[Drive]) -> list[Panel]:
    panels = []
    felt = [drive.felt() for drive in movers]
    for axis, name in enumerate(("f_x, forward", "f_y, left", "f_z, up, gravity removed")):
        curves = [Curve("wanted", movers[0].wanted_force[:, axis], 0)]
        curves += _beside(movers, [force[:, axis] for force, _ in felt])
        if _moves(curves):
            panels.append(Panel(f"{name} [m/s²]", movers[0].times, curves, height=220))
    return panels


def _rate_panels(movers: list[Drive]) -> list[Panel]:
    panels = []
    felt = [drive.felt() for drive in movers]
    for axis, name in enumerate(("roll rate", "pitch rate", "yaw rate")):
        curves = [Curve("wanted", np.degrees(movers[0].wanted_rates[:, axis]), 0)]
        curves += _beside(movers, [np.degrees(rates[:, axis]) for _, rates in felt])
        if _moves(curves):
            panels.append(Panel(f"{name} [deg/s]", movers[0].times, curves, height=170))
    rates_of = zip(movers, felt, strict=True)
    tilts = [np.degrees(tilt_rate(drive.wanted_rates, rates)) for drive, (_, rates) in rates_of]
    tilting = _beside(movers, tilts)
    panels.append(
        Panel("tilt rate nobody asked for [deg/s]", movers[0].times, tilting, limits=(3.0,))
    )
    return panels


def _platform_panels(drive: Drive) -> list[Panel]:
    machine, times = drive.machine, drive.times
    names = [axis.name.lower() for axis in Axis]
    places = [Curve(names[i], 1e3 * drive.pose[:, i], (1, 2, 3)[i]) for i in range(3)]
    angles = [Curve(names[i], np.degrees(drive.pose[:, i]), (1, 2, 3)[i - 3]) for i in (3, 4, 5)]
    legs = [Curve(f"leg {i + 1}", 1e3 * drive.legs[:, i], i) for i in range(6)]
    ends = (1e3 * machine.leg_min, 1e3 * machine.leg_max)
    panels = [
        Panel("place [mm]", times, places),
        Panel("attitude [deg]", times, angles),
        Panel("legs, pin to pin, and the ends of their stroke [mm]", times, legs, ends),
    ]
    periods = drive.periods
    if periods is None:
        return panels
    limits = [
        Curve(f"{names[i]} [mm or deg]", (1e3 if i < 3 else degrees(1.0)) * periods.x_max[:, i], c)
        for i, c in ((0, 1), (1, 2), (3, 3), (4, 4))
    ]
    kappa = Curve("", np.nan_to_num(periods.kappa), 1)
    return [
        *panels,
        Panel("X_max: position limits in force", periods.times, limits, bounds=(0.0, 240.0)),
        Panel(
            "kappa: share of the candidate that was let through",
            periods.times,
            [kappa],
            height=120,
            bounds=(-0.05, 1.05),
        ),
    ]
