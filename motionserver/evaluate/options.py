"""From what a person writes at the prompt to machine, tuning and disturbance."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from math import isfinite, radians
from pathlib import Path
from typing import Any, Final

import numpy as np

from motionserver.core.limits import Machine
from motionserver.cueing.reference import MODELS
from motionserver.cueing.tuning import Tuning
from motionserver.errors import ConfigError
from motionserver.settings.fields import TuningError
from motionserver.settings.tuning import apply_changes, default_for
from motionserver.settings.tuning_presets import NAME, PresetShelf

FREE_DEG_S: Final = 1000.0
"""The tilt rate that is called "free" [deg/s]."""
_FARTHEST: Final = 3.0


def machine_at(machine: Machine, head: str) -> Machine:
    """The machine with its head point at ``X,Y,Z`` [m]; as it is if empty.

    Raises:
        ConfigError: These are not three numbers of a head.
    """
    if not head:
        return machine
    parts = head.split(",")
    try:
        point = [float(part) for part in parts]
    except ValueError:
        point = []
    if len(point) != 3 or not all(abs(value) <= _FARTHEST for value in point):
        raise ConfigError(
            "--head",
            f"{head!r} is not X,Y,Z of the driver's head from the reference point",
            f"Give three numbers in metres, each at most {_FARTHEST:g}, for example 0,0,0.7.",
        )
    return machine.with_head(np.array(point))


def tuning_from(
    machine: Machine,
    preset: str = "",
    reference: str = "",
    tilt_rate: str = "",
    scale: float | None = None,
) -> Tuning:
    """Tunables: the defaults on this machine, then the preset, then what is said singly.

    Args:
        machine: Its box bounds the tuning's.
        preset: Name of a shipped preset, or a file of the same form (TOML, a table ``values``).
        reference: Reference model of surge and sway.
        tilt_rate: In deg/s, or "free".
        scale: Share of the motion that is wanted.

    Raises:
        ConfigError: One of them is wrong.
    """
    values: dict[str, Any] = _values(preset) if preset else {}
    if reference:
        if reference not in MODELS:
            raise ConfigError(
                "--reference",
                f"unknown model {reference!r}",
                f"Allowed: {', '.join(MODELS)}; what comes ahead is told by --preview.",
            )
        values["reference"] = reference
    try:
        model = apply_changes(default_for(machine), values)
        model.check_machine(machine)
    except TuningError as error:
        raise ConfigError(f"--tuning {preset}", str(error), "Correct this value.") from error
    tuning = model.to_tuning()
    if tilt_rate:
        tuning = replace(tuning, tilt_rate=_rate(tilt_rate))
    return tuning if scale is None else replace(tuning, scale=scale)


def _rate(text: str) -> float:
    """Radians per second; judging may go beyond what may be tuned while it moves."""
    try:
        rate = FREE_DEG_S if text == "free" else float(text)
    except ValueError:
        rate = float("nan")
    if not (isfinite(rate) and 0.1 <= rate <= FREE_DEG_S):
        raise ConfigError(
            "--tilt-rate", f"{text!r} is out of range", 'Give 0.1 to 1000 deg/s, or "free".'
        )
    return radians(rate)


def _values(preset: str) -> dict[str, Any]:
    path = Path(preset)
    shelf = PresetShelf(Path("no-user-presets"))
    built_in = [name for name in shelf.names() if NAME.fullmatch(name)]
    if path.suffix != ".toml":
        try:
            return dict(shelf.read(preset).values)
        except (TuningError, KeyError, OSError) as error:
            raise ConfigError(
                "--tuning",
                f"no preset {preset!r} ({error})",
                f"Give a file ending in .toml or one of {', '.join(built_in)}.",
            ) from error
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ConfigError(f"--tuning {preset}", f"cannot be read ({error})", "Mend it.") from error
    values = data.get("values")
    if not isinstance(values, dict):
        raise ConfigError(
            f"--tuning {preset}", "has no table [values]", "Write it like the shipped presets."
        )
    return values
