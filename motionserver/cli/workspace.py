"""check: what a configuration means, and what its machine reaches."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from motionserver.cli.serving import box_lines, describe, wrapped
from motionserver.core.axes import frozen
from motionserver.core.limits import machine_from_mapping
from motionserver.errors import ConfigError
from motionserver.evaluate.trial import refuse_lost, trial_lines, try_drive
from motionserver.evaluate.workspace.command import workspace_text
from motionserver.settings.config import load_config, run_dir_of
from motionserver.settings.machine import read_machine
from motionserver.settings.resolve import resolve
from motionserver.settings.tuning import apply_changes, default_for
from motionserver.settings.tuning_presets import PresetShelf

_RATE_HZ: Final = 60.0
"""Planner rate for a machine alone: that of the default configuration [Hz]."""


def check_text(
    path: Path | None,
    platform: str | None,
    html_out: Path | None,
    svg_out: Path | None,
    json_out: Path | None,
    with_drive: bool = True,
) -> str:
    """A configuration, or a machine alone, for people.

    Raises:
        ConfigError: Neither or both are given, something in them is wrong, or the machine cannot
            be driven.
    """
    if (path is None) == (platform is None):
        raise ConfigError(
            "check",
            "neither a configuration nor a platform" if path is None else "two machines",
            "Give CONFIG.toml, or --platform with a preset's name or a machine's .toml file.",
        )
    if path is None:
        assert platform is not None
        read = read_machine(platform)
        machine = read.machine
        model, shelf = default_for(machine), None
        period, arm = 1.0 / _RATE_HZ, None
        head = [f"{platform}: valid, limits {machine.digest}", *box_lines(read)]
    else:
        config = load_config(path)
        resolved = resolve(config, run_dir_of(config))
        machine = machine_from_mapping(resolved["machine"])
        model = apply_changes(default_for(machine), resolved["planner"]["tuning"])
        shelf = PresetShelf(Path(resolved["web"]["presets_dir"]))
        period, arm = resolved["planner"]["period"], frozen(resolved["planner"]["arm"])
        head = [describe(path)]
    if with_drive:
        trial = try_drive(machine, model.to_tuning(), period, arm)
        refuse_lost(trial, machine)
        head += wrapped(trial_lines(trial))
    text = workspace_text(
        machine, model, shelf, html_out=html_out, svg_out=svg_out, json_out=json_out
    )
    return "\n".join([*head, "", text])
