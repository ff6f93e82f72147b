"""The report as text."""

from __future__ import annotations

from motionserver import __version__
from motionserver.evaluate.tune.preset import preset_name
from motionserver.evaluate.tune.result import TuneResult
from motionserver.evaluate.tune.tables import Table, tables, trials_table, verdict


def facts(result: TuneResult) -> list[str]:
    """What was done, on what, judged how."""
    settings = result.settings
    base = settings.base
    length = f"the most eventful {settings.excerpt:g} s" if settings.excerpt else "all"
    return [
        f"motionserver {__version__}: {settings.algorithm} tuned for {settings.criterion.name}",
        f"{settings.criterion.meaning}",
        f"{len(result.trials)} trials, {len(result.names)} recordings ({length} of each), "
        f"seed {settings.seed}",
        f"machine {result.machine.name} ({result.machine.digest}), wanted scale {base.scale:g}, "
        f"tilt rate {base.tilt_rate_deg_s:g} deg/s, planner {settings.planner_hz:g} Hz",
    ]


def to_text(result: TuneResult) -> str:
    """Everything, aligned."""
    lines = [*facts(result), "", *verdict(result), ""]
    for table in (*tables(result), trials_table(result)):
        lines += [table.title, *aligned(table), *([table.note] if table.note else []), ""]
    lines += [f"preset: {preset_name(result)}.toml", "again:", f"  {result.command}"]
    return "\n".join(lines) + "\n"


def aligned(table: Table) -> list[str]:
    """Lines of a table, columns aligned."""
    rows = (table.head, *table.rows)
    widths = [max(len(row[i]) for row in rows) for i in range(len(table.head))]
    return [
        (
            "  "
            + row[0].ljust(widths[0])
            + "".join(
                "  " + cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True)
            )
        ).rstrip()
        for row in rows
    ]
