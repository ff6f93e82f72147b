"""What the report says, once, for text and page alike."""

from __future__ import annotations

from dataclasses import dataclass
from math import degrees
from typing import Final

from motionserver.evaluate.tune.criterion import OTHER_ROOM, TILT_ROOM
from motionserver.evaluate.tune.outcome import Outcome
from motionserver.evaluate.tune.result import TuneResult
from motionserver.evaluate.tune.sensitivity import noise, pool_of, sensitivities
from motionserver.evaluate.tune.space import Value

_FIGURES: Final = (
    ("nRMSE of f_x, f_y", "nrmse", 1.0),
    ("incongruence, peak / standing still", "incongruence", 1.0),
    ("incongruence, peak [m/s2]", "incongruence_peak", 1.0),
    ("sickness, W_f-weighted rms [m/s2]", "sickness", 1.0),
    ("RMSE of f_z [m/s2]", "rmse_heave", 1.0),
    ("RMSE of body rates [deg/s]", "rmse_rates", degrees(1.0)),
    ("tilt rate nobody asked for, p99 [deg/s]", "tilt_p99", degrees(1.0)),
    ("stroke used by the busiest leg", "stroke_used", 1.0),
    ("periods without a new plan", "refused", 1.0),
)


@dataclass(frozen=True, slots=True)
class Table:
    """A table of the report.

    Attributes:
        title: Heading.
        head: Names of the columns, the first for the row's name.
        rows: Cells as text.
        note: What must be known to read it.
    """

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""


def verdict(result: TuneResult) -> list[str]:
    """The outcome in sentences, the honest figure first."""
    default, inside = result.score(result.default), result.score(result.final.trial)
    held = result.held_out_score
    criterion = result.settings.criterion
    won = 100.0 * (1.0 - held / default)
    better = sum(
        criterion.score(f.trial.outcomes[f.held_out])
        < criterion.score(result.default.outcomes[f.held_out])
        for f in result.folds
    )
    count = len(result.folds)
    lines = [
        f"{criterion.name} on recordings not looked at: {held:.3f}, with the defaults "
        f"{default:.3f} ({abs(won):.1f} % {'less' if won >= 0.0 else 'MORE'}); "
        f"better on {better} of {count}",
        f"on the very recordings it was chosen on it is {inside:.3f}: the difference, "
        f"{held - inside:+.3f}, is what choosing flatters",
    ]
    if result.final.trial.number == 0:
        lines.append("the defaults are the best that was found: keep them")
    elif result.pays:
        lines.append("the preset is worth trying: choosing like this helps on unseen drives")
    else:
        lines.append(
            "KEEP THE DEFAULTS: on unseen drives choosing like this brings nothing, whatever the "
            "preset promises on the recordings it was chosen on"
        )
    if result.held_out_violations:
        lines.append(
            f"{result.held_out_violations} samples beyond a limit or rejected plans on held-out "
            "recordings: this must not be; look at the table of trials"
        )
    else:
        lines.append("no executed sample beyond a hard limit in any of the choices")
    bound = [p.name for p in result.settings.space if p.at_bound(result.final.trial.values[p.name])]
    if bound:
        lines.append(f"at the edge of what was searched: {', '.join(bound)}")
    return lines


def tables(result: TuneResult) -> list[Table]:
    """All tables but that of the trials."""
    return [_recordings(result), _parameters(result), _matters(result), _unseen(result)]


def trials_table(result: TuneResult) -> Table:
    """Every trial, best first, those out of the running last."""
    names = [p.name for p in result.settings.space]
    ranked = sorted(
        result.trials, key=lambda t: (bool(result.objection(t)), result.score(t), t.number)
    )
    rows = tuple(
        (
            f"{trial.number} {trial.origin}",
            f"{result.score(trial):.4f}",
            *(_cell(trial.values[name]) for name in names),
            result.objection(trial),
        )
        for trial in ranked
    )
    return Table(
        "All trials",
        ("trial", "mean score", *names, "out of the running because"),
        rows,
        "A hard limit broken or a plan rejected by the guard's check always disqualifies; so does "
        f"tilting beyond {TILT_ROOM:g} times the threshold (or the default), and an RMSE of f_z or "
        f"of turning beyond {OTHER_ROOM:g} times the default's: the criterion looks at forces "
        "alone and would sell them. Each fold asks this of the recordings it may see.",
    )


def _recordings(result: TuneResult) -> Table:
    score = result.settings.criterion.score
    rows = []
    for stretch, fold in zip(result.stretches, result.folds, strict=True):
        name = stretch.name
        rows.append(
            (
                name,
                f"{stretch.start:.2f}..{stretch.end:.2f}",
                f"{score(result.default.outcomes[name]):.3f}",
                f"{score(result.final.trial.outcomes[name]):.3f}",
                f"{score(fold.trial.outcomes[name]):.3f}",
                str(fold.trial.number),
                f"{fold.trial.outcomes[name].violations}",
            )
        )
    rows.append(
        (
            "mean",
            "",
            f"{result.score(result.default):.3f}",
            f"{result.score(result.final.trial):.3f}",
            f"{result.held_out_score:.3f}",
            "",
            f"{result.held_out_violations}",
        )
    )
    return Table(
        f"{result.settings.criterion.name} by recording",
        ("recording", "judged [s]", "default", "in-sample", "leave-one-out", "trial", "violations"),
        tuple(rows),
        "In-sample: the preset, chosen on all recordings. Leave-one-out: for each recording the "
        "values chosen on the others alone, trial and violations likewise.",
    )


def _parameters(result: TuneResult) -> Table:
    rows = []
    for p in result.settings.space:
        picked = [fold.trial.values[p.name] for fold in result.folds]
        searched = ", ".join(p.choices) if p.choices else f"{p.low:g}..{p.high:g}"
        between = (
            ", ".join(sorted({str(value) for value in picked}))
            if p.choices
            else f"{min(map(float, picked)):.3g}..{max(map(float, picked)):.3g}"
        )
        default, chosen = result.default.values[p.name], result.final.trial.values[p.name]
        rows.append((p.name, searched, _cell(default), _cell(chosen), between))
    return Table(
        "Chosen values",
        ("tunable", "searched", "default", "chosen", "chosen by the folds"),
        tuple(rows),
        f"Chosen = trial {result.final.trial.number}, the least mean score of "
        f"{result.final.candidates} trials in the running. Where the folds disagree widely the "
        "recordings do not settle the value.",
    )


def _matters(result: TuneResult) -> Table:
    count = len(pool_of(result))
    rows = []
    for item in sorted(sensitivities(result), key=lambda s: -s.spread):
        levels = [f"{label}: {_or_dash(score)}" for label, score in item.levels]
        tells = item.correlation is not None and abs(item.correlation) >= noise(count)
        word = (
            "" if not tells else "more is better" if (item.correlation or 0.0) < 0.0 else
            "less is better"
        )  # fmt: skip
        rows.append(
            (item.parameter.name, _or_dash(item.correlation, "+.2f"), f"{item.spread:.3f}",
             "; ".join(levels), word)
        )  # fmt: skip
    return Table(
        "What matters",
        ("tunable", "rank correlation", "spread", "mean score by part of the range", ""),
        tuple(rows),
        f"Over the {count} trials of the pool, all else varying too. "
        + (
            f"Chance alone exceeds a correlation of {noise(count):.2f} one time in twenty."
            if noise(count) < 1.0
            else "Too few to tell anything from chance."
        ),
    )


def _unseen(result: TuneResult) -> Table:
    rows = []
    for label, field, factor in _FIGURES:
        cells = [
            _mean(outcomes, field) * factor
            for outcomes in (
                list(result.default.outcomes.values()),
                list(result.final.trial.outcomes.values()),
                [fold.trial.outcomes[fold.held_out] for fold in result.folds],
            )
        ]
        rows.append((label, *(f"{cell:.3f}" for cell in cells)))
    return Table(
        "And all else",
        ("mean over the recordings", "default", "in-sample", "leave-one-out"),
        tuple(rows),
    )


def _mean(outcomes: list[Outcome], field: str) -> float:
    return sum(float(getattr(outcome, field)) for outcome in outcomes) / len(outcomes)


def _cell(value: Value) -> str:
    return value if isinstance(value, str) else f"{value:.4g}"


def _or_dash(value: float | None, form: str = ".3f") -> str:
    return "-" if value is None else format(value, form)
