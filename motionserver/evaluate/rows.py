"""The table of figures as sections of rows, for text and page alike."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import degrees
from typing import Final, TypeVar

from motionserver.evaluate.metrics.comfort import ComfortFigures
from motionserver.evaluate.metrics.fidelity import AxisFigures
from motionserver.evaluate.metrics.figures import Figures
from motionserver.evaluate.metrics.planning import PlanningFigures
from motionserver.evaluate.result import EvaluateResult

T = TypeVar("T")
NOTHING: Final = "-"


@dataclass(frozen=True, slots=True)
class Row:
    """One figure for every column.

    Attributes:
        label: What it is, with its unit.
        cells: Formatted, one per column.
        best: Columns that do best, where less (or more) is better; empty if nothing is.
        bad: Columns that must not be so.
    """

    label: str
    cells: tuple[str, ...]
    best: tuple[int, ...] = ()
    bad: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Section:
    """Rows under one heading."""

    title: str
    rows: tuple[Row, ...]


_AXES = {
    "f_x": "Longitudinal specific force f_x",
    "f_y": "Lateral specific force f_y",
    "f_z": "Vertical specific force f_z",
    "w_x": "Roll rate w_x",
    "w_y": "Pitch rate w_y",
    "w_z": "Yaw rate w_z",
}


def sections(result: EvaluateResult) -> list[Section]:
    """All figures; axes on which nothing is wanted and nothing felt are left out."""
    columns = result.figures
    yard, hind = (result.of(name).rmse_xy for name in ("yardstick", "hindsight"))
    out = [
        Section(
            "Horizontal specific force, x and y together",
            (
                _row("RMSE [m/s2]", columns, lambda f: f.rmse_xy, less=True),
                _row("nRMSE (1 = no motion)", columns, lambda f: f.nrmse_xy, less=True),
                _row("nRMSE below 0.1 Hz", columns, lambda f: f.xy.low, less=True),
                _row("nRMSE 0.1 to 0.5 Hz", columns, lambda f: f.xy.mid, less=True),
                _row("nRMSE above 0.5 Hz (onset)", columns, lambda f: f.xy.onset, less=True),
                _row("perceived-error nRMSE", columns, lambda f: f.xy.perceived, less=True),
                _row("correlation at no lag", columns, lambda f: f.xy.correlation, more=True),
                _row("RMSE / yardstick", columns, lambda f: f.rmse_xy / yard if yard else None),
                _row("RMSE / hindsight", columns, lambda f: f.rmse_xy / hind if hind else None),
            ),
        )
    ]
    for name, title in _AXES.items():
        axes = [figures.axis(name) for figures in columns]
        if any(max(axis.rmse, axis.wanted_rms) > 1e-6 for axis in axes):
            out.append(Section(title, _axis_rows(axes)))
    out.append(Section("What the person notices", _comfort_rows([f.comfort for f in columns])))
    out.append(Section("Workspace (executed samples, plain differences)", _workspace_rows(columns)))
    out.append(Section("Planning", _planning_rows([f.planning for f in columns])))
    return out


def _axis_rows(axes: list[AxisFigures]) -> tuple[Row, ...]:
    turns = axes[0].axis.startswith("w")
    unit, to_unit = ("deg/s", degrees) if turns else ("m/s2", float)
    rows = [
        _row(f"wanted rms [{unit}]", axes, lambda a: to_unit(a.wanted_rms)),
        _row(f"RMSE [{unit}]", axes, lambda a: to_unit(a.rmse), less=True),
        _row("nRMSE", axes, lambda a: a.nrmse, less=True),
        _row("nRMSE below 0.1 Hz", axes, lambda a: a.nrmse_low, less=True),
        _row("nRMSE 0.1 to 0.5 Hz", axes, lambda a: a.nrmse_mid, less=True),
        _row("nRMSE above 0.5 Hz (onset)", axes, lambda a: a.nrmse_onset, less=True),
        _row("perceived-error nRMSE", axes, lambda a: a.perceived_nrmse, less=True),
        _row("correlation at no lag", axes, lambda a: a.correlation, more=True),
        _row(
            "best lag of -200 to 1000 [ms]",
            axes,
            lambda a: None if a.lag is None else 1e3 * a.lag,
            "{:.0f}",
        ),
        _row("correlation at best lag", axes, lambda a: a.lag_correlation, more=True),
        _row("gain at best lag", axes, lambda a: a.gain),
        _row("R2 of that gain", axes, lambda a: a.r2, more=True),
        _row("false-cue index", axes, lambda a: a.false_cue),
        _row("false-cue time [%]", axes, lambda a: 100.0 * a.false_share, "{:.1f}"),
        _row("missing-cue index", axes, lambda a: a.missing_cue, less=True),
    ]
    return tuple(row for row in rows if any(cell != NOTHING for cell in row.cells))


def _comfort_rows(comfort: list[ComfortFigures]) -> tuple[Row, ...]:
    return (
        _row("incongruence rating, peak [m/s2]", comfort, lambda c: c.rating_peak, less=True),
        _row("incongruence rating, mean [m/s2]", comfort, lambda c: c.rating_mean, less=True),
        _row(
            "tilt rate nobody asked for, max [deg/s]", comfort, lambda c: degrees(c.tilt_rate_max)
        ),
        _row("tilt rate, p99 [deg/s]", comfort, lambda c: degrees(c.tilt_rate_p99)),
        _row("time above 3 deg/s [%]", comfort, lambda c: 100.0 * c.tilt_share, "{:.1f}"),
        _row("acceleration against the cue, max [m/s2]", comfort, lambda c: c.washout_max),
        _row("time above 0.1 m/s2 [%]", comfort, lambda c: 100.0 * c.washout_share, "{:.1f}"),
    )


def _workspace_rows(columns: tuple[Figures, ...]) -> tuple[Row, ...]:
    spaces = [figures.workspace for figures in columns]
    rows = [
        _row(
            "violations (must be 0)",
            spaces,
            lambda w: float(w.violations),
            "{:.0f}",
            wrong=lambda value: value > 0,
        ),
        _row("stroke used p1-p99, one leg [%]", spaces, lambda w: 100.0 * w.stroke_used, "{:.0f}"),
        _row("stroke used, mean leg [%]", spaces, lambda w: 100.0 * w.stroke_used_mean, "{:.0f}"),
    ]
    for index, margin in enumerate(spaces[0].margins):
        limit = "not checked" if margin.limit is None else f"{margin.limit:.4g}"
        label = f"{margin.name}, limit {limit} [{margin.unit}]: left"
        rows.append(_row(label, [w.margins[index] for w in spaces], lambda m: m.margin))
    for index, (name, unit, factor) in enumerate(
        (
            ("surge", "mm", 1e3),
            ("sway", "mm", 1e3),
            ("heave", "mm", 1e3),
            ("roll", "deg", degrees(1.0)),
            ("pitch", "deg", degrees(1.0)),
            ("yaw", "deg", degrees(1.0)),
        )
    ):
        values = [factor * w.excursion[index] for w in spaces]
        rows.append(_row(f"largest {name} [{unit}]", values, float, "{:.1f}"))
    return tuple(rows)


def _planning_rows(planning: list[PlanningFigures | None]) -> tuple[Row, ...]:
    def row(
        label: str,
        take: Callable[[PlanningFigures], float],
        form: str = "{:.3g}",
        wrong: Callable[[float], bool] | None = None,
    ) -> Row:
        return _row(label, planning, lambda p: None if p is None else take(p), form, wrong=wrong)

    return (
        row("candidates whole, kappa = 1 [%]", lambda p: 100.0 * p.whole, "{:.2f}"),
        row("halved, 0 < kappa < 1 [%]", lambda p: 100.0 * p.halved, "{:.2f}"),
        row("refused, kappa = 0 [%]", lambda p: 100.0 * p.refused, "{:.2f}"),
        row("no candidate [%]", lambda p: 100.0 * p.without, "{:.2f}"),
        row(
            "rejected by the guard's check (must be 0)",
            lambda p: float(p.rejected),
            "{:.0f}",
            lambda value: value > 0,
        ),
        row("time to plan, p50 [ms]", lambda p: p.plan_p50_ms),
        row("time to plan, p99 [ms]", lambda p: p.plan_p99_ms),
        row("time to plan, p99.9 [ms]", lambda p: p.plan_p999_ms),
        row("time to plan, longest [ms]", lambda p: p.plan_max_ms),
        row("solver iterations, median", lambda p: p.iterations_p50, "{:.0f}"),
        row("solver iterations, most", lambda p: float(p.iterations_max), "{:.0f}"),
    )


def _row(
    label: str,
    columns: Sequence[T],
    take: Callable[[T], float | None],
    form: str = "{:.3f}",
    *,
    less: bool = False,
    more: bool = False,
    wrong: Callable[[float], bool] | None = None,
) -> Row:
    values = [take(column) for column in columns]
    cells = tuple(NOTHING if value is None else form.format(value) for value in values)
    known = [value for value in values if value is not None]
    best: tuple[int, ...] = ()
    if (less or more) and len(known) > 1:
        top = cells[values.index(min(known) if less else max(known))]
        best = tuple(i for i, cell in enumerate(cells) if cell == top)
    bad = tuple(
        i
        for i, value in enumerate(values)
        if wrong is not None and value is not None and wrong(value)
    )
    return Row(label, cells, best if len(best) < len(cells) else (), bad)
