"""The table as aligned text."""

from __future__ import annotations

from math import degrees

from motionserver import __version__
from motionserver.core.axes import Array
from motionserver.evaluate.hindsight import HINDSIGHT_RULE
from motionserver.evaluate.result import EvaluateResult
from motionserver.evaluate.rows import sections
from motionserver.evaluate.yardstick import RULE


def to_text(result: EvaluateResult) -> str:
    """All figures as an aligned table, what they were measured on above, the verdict below."""
    machine, recording, tuning = result.machine, result.recording, result.tuning
    names = [figures.name for figures in result.figures]
    table = sections(result)
    label = max(len(row.label) for section in table for row in section.rows) + 2
    widths = [
        max(len(name), *(len(row.cells[i]) for section in table for row in section.rows)) + 2
        for i, name in enumerate(names)
    ]
    lines = [
        f"motionserver {__version__}: {recording.name}, {recording.duration:.2f} s, "
        f"scale {tuning.scale:g}",
        f"machine {machine.name} ({machine.digest}), planner {result.planner_hz:g} Hz, "
        f"judged on executed samples at {result.rate:g} Hz",
        f"driver's head at {_point(machine.head)} m, reference {tuning.reference}, tilt rate "
        f"{degrees(tuning.tilt_rate):g} deg/s",
        f"yardstick: {RULE}; gain {result.yardstick.gain:g}",
        f"hindsight: {HINDSIGHT_RULE}; here {result.hindsight.described()}",
        "",
        " " * label + "".join(name.rjust(width) for name, width in zip(names, widths, strict=True)),
    ]
    for section in table:
        lines += ["", section.title]
        lines += [
            "  "
            + row.label.ljust(label - 2)
            + "".join(cell.rjust(width) for cell, width in zip(row.cells, widths, strict=True))
            for row in section.rows
        ]
    return "\n".join([*lines, "", *remarks(result)]) + "\n"


def _point(point: Array) -> str:
    return ", ".join(f"{value:g}" for value in point)


def remarks(result: EvaluateResult) -> list[str]:
    """What must be said whatever the figures are: safety first, then who wins, then why not."""
    out = [
        f"{result.violations} executed samples beyond a limit, {result.rejected} plans rejected by "
        "the guard's check"
        + (": as it must be" if result.violations + result.rejected == 0 else "")
    ]
    if result.preview > 0.0:
        out.append(
            f"the algorithms were told {result.preview:g} s ahead, as closely as one packet "
            "carries it, the rivals nothing: an upper bound, not what a simulator without preview "
            "gets"
        )
    if result.disturbance is not None:
        trouble = result.disturbance
        out.append(
            f"the algorithms were troubled (seed {trouble.seed}): {100 * trouble.stalled:g} % of "
            f"plans stalled for {1e3 * trouble.stall:g} ms, {100 * trouble.failed:g} % failed, "
            f"{100 * trouble.nan:g} % were not numbers"
        )
    rivals = [result.of(name) for name in ("yardstick", "hindsight", "no motion")]
    for figures in result.figures:
        planning = figures.planning
        if planning is None or figures in rivals:
            continue
        against = [
            f"{'below' if figures.rmse_xy < rival.rmse_xy else 'NOT below'} {rival.name} "
            f"({rival.rmse_xy:.3f})"
            for rival in rivals
        ]
        out.append(f"{figures.name}: RMSE(x, y) {figures.rmse_xy:.3f} m/s2 is {', '.join(against)}")
        for what, reasons in (
            ("the governor halved or refused", planning.refusals),
            ("no candidate", planning.troubles),
            ("samples not believed", planning.unbelieved),
        ):
            if reasons:
                counts = ", ".join(f"{reason} {count}" for reason, count in reasons.items())
                out.append(f"{figures.name}: {what}: {counts}")
    return out
