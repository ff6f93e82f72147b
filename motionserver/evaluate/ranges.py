"""What may be asked of an evaluation, checked before anything is driven."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from motionserver.core.limits import Machine
from motionserver.cueing.registry import algorithms as known_algorithms
from motionserver.cueing.think import prepare
from motionserver.cueing.tuning import Tuning
from motionserver.errors import ConfigError, TunableError
from motionserver.evaluate.hearing import LONGEST_PREVIEW

PLANNER_RATES_HZ: Final = (20.0, 250.0)
"""Slowest and fastest planner that is driven offline [Hz]."""
RATES_HZ: Final = (10.0, 2000.0)
"""Slowest and fastest rate of executed samples [Hz]."""


def check_algorithms(names: Sequence[str]) -> None:
    """Make sure that there are such algorithms, at least one, and none of them twice.

    Raises:
        ConfigError: There are not.
    """
    known = known_algorithms()
    for name in names:
        if name not in known:
            raise ConfigError(
                "--algorithm", f"unknown algorithm {name!r}", f"Allowed: {', '.join(known)}."
            )
    if not names or len(set(names)) < len(names):
        raise ConfigError(
            "--algorithm",
            f"{len(names)} given, each may stand once and one is needed",
            f"Give one or more of {', '.join(known)}, separated by commas.",
        )


def check_made(machine: Machine, tuning: Tuning, names: Sequence[str], planner_hz: float) -> None:
    """Make every algorithm once, so that what is missing is said before anything is driven.

    Raises:
        ConfigError: One cannot be made with these tunables.
    """
    for name in names:
        try:
            prepare(machine, replace(tuning, algorithm=name), 1.0 / planner_hz)
        except TunableError as error:
            raise ConfigError(
                f"tuning of {name}: {error.tunable}", error.what, f"Allowed: {error.allowed}."
            ) from error


def check_scale(scale: float) -> None:
    """Make sure that some of the motion is wanted, and no more than all of it.

    Raises:
        ConfigError: It is not so.
    """
    if not 0.0 < scale <= 1.0:
        raise ConfigError("--scale", f"{scale:g} is out of range", "Give a share in (0, 1].")


def check_times(rate: float, planner_hz: float, preview: float) -> None:
    """Make sure that rates [Hz] and preview [s] are some that can be driven.

    Raises:
        ConfigError: One is not.
    """
    for option, value, (low, high), unit in (
        ("--rate", rate, RATES_HZ, "Hz"),
        ("--planner-rate", planner_hz, PLANNER_RATES_HZ, "Hz"),
        ("--preview", preview, (0.0, LONGEST_PREVIEW), "s"),
    ):
        if not low <= value <= high:
            raise ConfigError(
                option, f"{value:g} {unit} is out of range", f"Give {low:g} to {high:g} {unit}."
            )
