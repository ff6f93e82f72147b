"""Figures 3 and 4 as SVG, and the page around them."""

from __future__ import annotations

from html import escape

import numpy as np

from motionserver import __version__
from motionserver.core.axes import Axis
from motionserver.evaluate.html import document
from motionserver.evaluate.reproduce.paper import NOISE, PLANT_GAIN, Run
from motionserver.evaluate.reproduce.thondel2014 import (
    CERTIFIED,
    MPC_BOX,
    MPC_HALVING,
    MPC_TABLE1,
    NOISE_RAW,
    NOISE_SLOW,
    SCALED,
    STANDARD,
    Claim,
    Reproduction,
)
from motionserver.evaluate.svg import STYLE as PLOT_STYLE
from motionserver.evaluate.svg import Curve, Panel, figure, spans_where


def figure3(found: Reproduction, signal: str = "step") -> list[Panel]:
    """Wanted and felt acceleration, displacement, inclination; the error interval highlighted."""
    standard = found.run(signal, STANDARD)
    spans = spans_where(standard.signal.times, standard.outside(found.machine.box))
    chosen = [
        (standard, "standard MCA", 2),
        (found.run(signal, SCALED), "scaled", 3),
        (found.run(signal, MPC_BOX), "MPC-MCA", 1),
    ]
    return _panels(found, chosen, spans)


def figure_variants(found: Reproduction, signal: str = "step") -> list[Panel]:
    """The constraints in turn: box, thresholds, halving, legs."""
    chosen = [
        (found.run(signal, MPC_BOX), "box of Table 2", 1),
        (found.run(signal, MPC_HALVING), "halving (7)(8)", 4),
        (found.run(signal, CERTIFIED), "leg rows, verified", 3),
        (found.run(signal, MPC_TABLE1), "Table 1 soft", 5),
    ]
    times = chosen[0][0].signal.times
    limits = [Curve(label, 1e3 * run.x_max, colour) for run, label, colour in chosen[1:3]]
    return [
        *_panels(found, chosen, []),
        Panel("X_max of surge [mm]", times, limits, height=130, bounds=(0.0, 220.0)),
    ]


def figure4(found: Reproduction) -> list[Panel]:
    """The measured acceleration with its noise, and what becomes of it."""
    slow, rough = found.run("step", NOISE_SLOW), found.run("step", NOISE_RAW)
    times = slow.signal.times
    measured = Panel(
        f"measured acceleration, white noise of {NOISE:g} m/s² [m/s²]",
        times,
        [
            Curve("measured", found.measured[0], 0),
            Curve("wanted", slow.signal.wanted, 2),
            Curve("felt", slow.force, 1),
        ],
        height=230,
    )
    chosen = [(rough, "raw substitution", 2), (slow, "slow disturbance estimate", 1)]
    return [measured, *_panels(found, chosen, [])[1:]]


def _panels(
    found: Reproduction, chosen: list[tuple[Run, str, int]], spans: list[tuple[float, float]]
) -> list[Panel]:
    times, box = chosen[0][0].signal.times, found.machine.box
    reach, lean = 1e3 * float(box[Axis.SURGE]), float(np.degrees(box[Axis.PITCH]))
    force = [Curve("wanted", chosen[0][0].signal.wanted, 0)]
    force += [Curve(label, run.force, colour) for run, label, colour in chosen]
    place = [Curve(label, 1e3 * run.x, colour) for run, label, colour in chosen]
    tilt = [Curve(label, np.degrees(run.tilt), colour) for run, label, colour in chosen]
    return [
        Panel("acceleration a [m/s²]", times, force, spans=spans, height=230),
        Panel("displacement x [mm]", times, place, (reach, -reach), spans),
        Panel("inclination φ [deg]", times, tilt, (lean, -lean), spans),
    ]


def page(found: Reproduction, tried: list[Claim]) -> str:
    """The whole reproduction as one self-contained page."""
    lost = sum(not claim.holds for claim in tried)
    rows = "".join(
        f"<tr><td>{escape(claim.text)}</td><td>{escape(claim.found)}</td>"
        f'<td class="{"best" if claim.holds else "bad"}">{"PASS" if claim.holds else "FAIL"}</td>'
        "</tr>"
        for claim in tried
    )
    plots = (
        ("Figure 3: launch, 3.5 m/s² for 7 s", figure3(found)),
        ("The same for a truck's stop at 6 m/s²", figure3(found, "brake")),
        ("The same for forty seconds of town", figure3(found, "drive")),
        ("Figure 4: white noise on the measured acceleration", figure4(found)),
        ("Beside the paper: thresholds, halving, legs", figure_variants(found)),
    )
    notes = {
        3: f"The platform does {PLANT_GAIN:g} of its command. With the slow estimate the drawn x "
        "and φ are the set-points; with raw substitution they are the platform's.",
        0: "Shaded: the error interval, where the standard MCA is outside the limits (dashed).",
    }
    figures = "".join(
        f"<h2>{escape(title)}</h2>"
        + (f'<p class="soft">{escape(notes[number])}</p>' if number in notes else "")
        + f'<div class="frame">{figure(panels)}</div>'
        for number, (title, panels) in enumerate(plots)
    )
    return document(
        "Thöndel 2014, reproduced",
        PLOT_STYLE + ".claims td:nth-child(2){text-align:left;white-space:normal}",
        '<p class="soft">Model predictive motion cueing algorithm for a truck simulator, '
        f"ECMS 2014, figures 3 and 4, by the server's own code on {escape(found.machine.name)} "
        f"<code>{found.machine.digest}</code>; filters and signals are ours, the paper prints "
        f"none. motionserver {__version__}.</p>"
        f"<p>{len(tried) - lost} of {len(tried)} claims hold.</p>{figures}"
        f'<h2>Claims</h2><div class="frame"><table class="claims"><tbody>{rows}'
        "</tbody></table></div>"
        f'<h2>All runs</h2><div class="frame">{_table(found)}</div>',
    )


def _table(found: Reproduction) -> str:
    head = "".join(
        f"<th>{name}</th>"
        for name in ("signal, variant", "RMSE", "corr.", "x [mm]", "φ [deg]", "φ' [deg/s]",
                     "outside box [%]", "outside legs [%]")
    )  # fmt: skip
    out = [f"<table><thead><tr>{head}</tr></thead><tbody>"]
    for (signal, variant), run in found.runs.items():
        cells = (
            f"{run.rmse:.3f}",
            f"{run.correlation:.3f}",
            f"{1e3 * np.max(np.abs(run.x)):.1f}",
            f"{np.degrees(np.max(np.abs(run.tilt))):.2f}",
            f"{np.degrees(np.max(np.abs(run.tilt_rate))):.1f}",
            f"{100.0 * np.mean(run.outside(found.machine.box)):.1f}",
            f"{100.0 * run.legs_outside:.1f}",
        )
        out.append(
            f"<tr><td>{escape(signal)}, {escape(variant)}</td>"
            + "".join(f"<td>{cell}</td>" for cell in cells)
            + "</tr>"
        )
    return "".join(out) + "</tbody></table>"
