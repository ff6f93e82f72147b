"""The files a search leaves: the preset, and all figures as JSON."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

import tomli_w

from motionserver import __version__
from motionserver.bounded_files import MIB, read_bounded_text
from motionserver.cueing.tuning import Tuning
from motionserver.errors import ConfigError
from motionserver.evaluate.tune.result import TuneResult
from motionserver.settings.fields import TuningError
from motionserver.settings.tuning import TuningModel, apply_changes

SCHEMA = "motionserver-tuning-1"
LARGEST_RESULT: Final = 64 * MIB
"""Largest ``result.json`` that is read."""


def preset_name(result: TuneResult) -> str:
    """A name the shelf of presets takes."""
    return f"{result.settings.algorithm}-{result.settings.criterion.name}"[:40]


def preset_values(result: TuneResult) -> dict[str, Any]:
    """What the preset sets: the chosen values, and what they were chosen for."""
    base = result.settings.base
    held = {
        "algorithm": base.algorithm,
        "scale": base.scale,
        "tilt_rate_deg_s": base.tilt_rate_deg_s,
    }
    return held | result.final.trial.values


def preset_about(result: TuneResult) -> str:
    """One line for the reader, at most 200 characters."""
    still, default = result.held_out_score, result.score(result.default)
    return (
        f"Tuned for {result.settings.criterion.name} on {len(result.names)} recordings on "
        f"{result.machine.name}: {still:.3f} on drives not seen, default {default:.3f}. "
        f"{'' if result.pays else 'Does not pay. '}See report.html."
    )[:200]


def preset_text(result: TuneResult) -> str:
    """The preset as TOML, with the command that made it."""
    body = tomli_w.dumps({"about": preset_about(result), "values": preset_values(result)})
    return f"# {result.command}\n# machine {result.machine.digest}\n{body}"


def to_mapping(result: TuneResult) -> dict[str, Any]:
    """Everything as plain numbers and text."""
    settings = result.settings
    return {
        "schema": SCHEMA,
        "version": __version__,
        "command": result.command,
        "algorithm": settings.algorithm,
        "criterion": settings.criterion.name,
        "machine": {"name": result.machine.name, "digest": result.machine.digest},
        "planner_hz": settings.planner_hz,
        "base": settings.base.model_dump(),
        "stretches": [
            {"name": s.name, "start_s": s.start, "end_s": s.end, "digest": s.digest}
            for s in result.stretches
        ],
        "default_score": result.score(result.default),
        "in_sample_score": result.score(result.final.trial),
        "held_out_score": result.held_out_score,
        "pays": result.pays,
        "chosen": {"trial": result.final.trial.number, "values": result.final.trial.values},
        "folds": {
            fold.held_out: {"trial": fold.trial.number, "values": fold.trial.values}
            for fold in result.folds
        },
        "trials": [
            {
                "number": trial.number,
                "origin": trial.origin,
                "values": trial.values,
                "score": result.score(trial),
                "objection": result.objection(trial),
                "outcomes": {n: o.to_mapping() for n, o in trial.outcomes.items()},
            }
            for trial in result.trials
        ],
    }


def to_json(result: TuneResult) -> str:
    """`to_mapping` as text."""
    return json.dumps(to_mapping(result), indent=1, allow_nan=False) + "\n"


def read_fold_tunings(path: str | Path) -> dict[str, Tuning]:
    """For each recording the tuning chosen without it, from a ``result.json``.

    Raises:
        ConfigError: The file is not one.
    """
    try:
        data = json.loads(read_bounded_text(path, LARGEST_RESULT))
        if data["schema"] != SCHEMA:
            raise ValueError(f"its schema is {data['schema']!r}, not {SCHEMA!r}")
        base = TuningModel.model_validate(data["base"])
        return {
            name: apply_changes(base, fold["values"]).to_tuning()
            for name, fold in data["folds"].items()
        }
    except (OSError, ValueError, KeyError, TypeError, AttributeError, TuningError) as error:
        what = f"it has no {error}" if isinstance(error, KeyError) else str(error)
        raise ConfigError(
            f"--held-out {path}",
            f"no result of 'motionserver tune' ({what})",
            "Name its result.json.",
        ) from error
