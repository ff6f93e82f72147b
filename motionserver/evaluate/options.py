"""From what a person writes at the prompt to machine, tuning and disturbance."""

from __future__ import annotations

import sys
import tomllib
from dataclasses import dataclass, replace
from math import isfinite, radians
from pathlib import Path
from typing import Any, Final

import numpy as np

from motionserver.bounded_files import SETTINGS_BYTES, read_bounded_text
from motionserver.core.limits import Machine
from motionserver.cueing.reference import MODELS
from motionserver.cueing.tuning import Tuning
from motionserver.errors import ConfigError
from motionserver.evaluate.disturbance import Disturbance
from motionserver.evaluate.drive import RATE_HZ
from motionserver.evaluate.live import Live
from motionserver.evaluate.lockstep import PLANNER_HZ
from motionserver.evaluate.ranges import check_scale, check_times
from motionserver.settings.fields import TuningError
from motionserver.settings.machine import load_machine
from motionserver.settings.tuning import apply_changes, default_for, readable
from motionserver.settings.tuning_presets import NAME, PresetShelf

FREE_DEG_S: Final = 1000.0
"""The tilt rate that is called "free" [deg/s]."""
_FARTHEST: Final = 3.0
"""Of a head from the reference point, along each axis [m]."""


@dataclass(frozen=True, slots=True)
class EvaluateOptions:
    """What was written at the prompt, as it was written.

    Attributes:
        algorithm: Names, comma between.
        platform: Preset or file of the machine.
        scale: Share of the motion that is wanted; None for the tuning's.
        rate: Rate of judging [Hz].
        planner_hz: Planner rate [Hz].
        head: ``X,Y,Z`` [m], or empty.
        reference: Reference model, or empty.
        tilt_rate: In deg/s, "free", or empty.
        preset: Preset or file of tunables, or empty.
        preview: How far the recording is told ahead [s].
        disturb: Whether planners are troubled.
        seed: Of the trouble.
        jobs: Processes at the same time.
        held_out: A ``result.json`` of ``tune``, or None: with --compare each recording is driven
            with the tunables that were chosen without it.
        setpoints: File for set-points, or None.
        json_out: File for figures, or None.
        html_out: File for the page, or None.
        told: Names of the options that were written; the others may be as a live drive was.

    Raises:
        ConfigError: A rate or the preview is out of range.
    """

    algorithm: str
    platform: str = "t2-compact"
    scale: float | None = None
    rate: float = RATE_HZ
    planner_hz: float = PLANNER_HZ
    head: str = ""
    reference: str = ""
    tilt_rate: str = ""
    preset: str = ""
    preview: float = 0.0
    disturb: bool = False
    seed: int = 0
    jobs: int = 2
    held_out: Path | None = None
    setpoints: Path | None = None
    json_out: Path | None = None
    html_out: Path | None = None
    told: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        check_times(self.rate, self.planner_hz, self.preview)

    def algorithms(self) -> list[str]:
        """Names of algorithms."""
        return [name.strip() for name in self.algorithm.split(",") if name.strip()]

    def machine(self) -> Machine:
        """The platform with the head where it is wanted."""
        return machine_at(load_machine(self.platform), self.head)

    def tuning(self) -> Tuning:
        """All tunables."""
        return tuning_from(self.machine(), self.preset, self.reference, self.tilt_rate, self.scale)

    def for_drive(self, live: Live | None) -> tuple[list[str], Machine, Tuning, float]:
        """Algorithms, machine, tunables and planner rate: what is not told as it was live."""
        if live is None:
            return self.algorithms(), self.machine(), self.tuning(), self.planner_hz
        machine = self.machine() if "platform" in self.told else machine_at(live.machine, self.head)
        names, own = self.algorithms(), str(live.tuning.get("algorithm", ""))
        if "algorithm" not in self.told:
            names = [own, *(name for name in names if name != own)]
        where, values = (
            ("--tuning " + self.preset, _values(self.preset))
            if self.preset
            else (
                "the recording's settings",
                live.tuning,
            )
        )
        tuning = _tuning(machine, values, where, self.reference, self.tilt_rate, self.scale)
        rate = self.planner_hz if "planner_rate" in self.told else live.planner_hz
        return names, machine, tuning, rate

    def disturbance(self) -> Disturbance | None:
        """The trouble, if any is wanted."""
        return Disturbance(seed=self.seed) if self.disturb else None


def machine_at(machine: Machine, head: str) -> Machine:
    """The machine with its head point at ``X,Y,Z`` [m]; as it is if empty.

    Raises:
        ConfigError: These are not three numbers of a head.
    """
    point = head_point(head)
    return machine if point is None else machine.with_head(np.array(point))


def head_point(text: str) -> tuple[float, float, float] | None:
    """The head point of ``X,Y,Z`` [m]; None if empty.

    Raises:
        ConfigError: These are not three numbers of a head.
    """
    if not text:
        return None
    try:
        x, y, z = (float(part) for part in text.split(","))
        if all(abs(value) <= _FARTHEST for value in (x, y, z)):
            return x, y, z
    except ValueError:
        pass
    raise ConfigError(
        "--head",
        f"{text!r} is not X,Y,Z of the driver's head from the reference point",
        f"Give three numbers in metres, each at most {_FARTHEST:g}, for example 0,0,0.7.",
    )


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
    values = _values(preset) if preset else {}
    return _tuning(machine, values, f"--tuning {preset}", reference, tilt_rate, scale)


def _tuning(
    machine: Machine,
    values: dict[str, Any],
    where: str,
    reference: str,
    tilt_rate: str,
    scale: float | None,
) -> Tuning:
    if reference:
        if reference not in MODELS:
            raise ConfigError(
                "--reference",
                f"unknown model {reference!r}",
                f"Allowed: {', '.join(MODELS)}; what comes ahead is told by --preview.",
            )
        values = {**values, "reference": reference}
    values, left_out = readable(values)
    for warning in left_out:
        print(f"{where}: {warning}", file=sys.stderr)  # noqa: T201
    try:
        model = apply_changes(default_for(machine), values)
        model.check_machine(machine)
    except TuningError as error:
        raise ConfigError(where, str(error), "Correct this value.") from error
    tuning = model.to_tuning()
    if tilt_rate:
        tuning = replace(tuning, tilt_rate=_rate(tilt_rate))
    if scale is None:
        return tuning
    check_scale(scale)
    return replace(tuning, scale=scale)


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
        data = tomllib.loads(read_bounded_text(path, SETTINGS_BYTES))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ConfigError(f"--tuning {preset}", f"cannot be read ({error})", "Mend it.") from error
    values = data.get("values")
    if not isinstance(values, dict):
        raise ConfigError(
            f"--tuning {preset}", "has no table [values]", "Write it like the shipped presets."
        )
    return values
