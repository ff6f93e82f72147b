"""The table as aligned text."""

from __future__ import annotations

from motionserver import __version__
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
        f"yardstick: {RULE}; gain {result.yardstick.gain:g}",
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


def remarks(result: EvaluateResult) -> list[str]:
    """What must be said whatever the figures are: safety first, then who wins, then why not."""
    out = [
        f"{result.violations} executed samples beyond a limit, {result.rejected} plans rejected by "
        "the guard's check"
        + (": as it must be" if result.violations + result.rejected == 0 else "")
    ]
    if result.preview > 0.0:
        out.append(
            f"the algorithms were told {result.preview:g} s ahead, the rivals nothing: an upper "
            "bound, not what a simulator without preview gets"
        )
    yard, still = result.of("yardstick"), result.of("no motion")
    for figures in result.figures:
        planning = figures.planning
        if planning is None or figures.name == "yardstick":
            continue
        against = [
            f"{'below' if figures.rmse_xy < rival.rmse_xy else 'NOT below'} {rival.name} "
            f"({rival.rmse_xy:.3f})"
            for rival in (yard, still)
        ]
        out.append(
            f"{figures.name}: RMSE(x, y) {figures.rmse_xy:.3f} m/s2 is {' and '.join(against)}"
        )
        for what, reasons in (
            ("the governor halved or refused", planning.refusals),
            ("no candidate", planning.troubles),
            ("samples not believed", planning.unbelieved),
        ):
            if reasons:
                counts = ", ".join(f"{reason} {count}" for reason, count in reasons.items())
                out.append(f"{figures.name}: {what}: {counts}")
    return out
