"""A few seconds of driving off-line: does this machine move with this tuning, on this computer?

A synthetic drive that asks for every axis goes through the server's own planner, governor and
verification. What comes out is the same on every computer, but for the times.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from time import perf_counter
from typing import Final

import numpy as np

from motionserver.core.axes import GRAVITY, Array
from motionserver.core.limits import Machine
from motionserver.cueing.tuning import Tuning
from motionserver.errors import ConfigError
from motionserver.evaluate.lockstep import drive
from motionserver.evaluate.metrics.workspace import workspace_figures
from motionserver.evaluate.recording import Recording, from_samples

LONGEST: Final = 5.0
"""Length of the drive [s]."""
SHORTEST: Final = 2.0
"""The same on a computer that is too slow for more [s]."""
PATIENCE: Final = 4.0
"""How long it may take, about [s]."""
_PROBE: Final = 0.25
_MOST_LOST: Final = 0.2
"""Share of periods without a plan from which on the machine cannot be driven."""
_RATE_HZ: Final = 200.0
_SAMPLES: Final = 100


@dataclass(frozen=True, slots=True)
class Trial:
    """What a short drive brought.

    Attributes:
        algorithm: What drove.
        seconds: Length of the drive [s].
        periods: Planner periods.
        troubles: Periods in which the algorithm found no plan, by what it said.
        rejections: Plans that the guard's verification refused, by reason.
        stopped: Periods in which the governor let nothing of a plan through.
        cut: Periods in which it let only a part through.
        violations: Executed samples beyond a limit of the machine.
        late: Periods whose plan took longer than the period on this computer.
        median: Median time for one plan on this computer [s].
        period: Planner period [s].
    """

    algorithm: str
    seconds: float
    periods: int
    troubles: dict[str, int]
    rejections: dict[str, int]
    stopped: int
    cut: int
    violations: int
    late: int
    median: float
    period: float

    @property
    def lost(self) -> int:
        """Periods that brought no plan that moves the platform."""
        return sum(self.troubles.values()) + sum(self.rejections.values()) + self.stopped


def demanding_drive(duration: float) -> Recording:
    """Braking, slalom, bumps: forces and rates on every axis."""
    times = np.arange(round(duration * _SAMPLES) + 1) / _SAMPLES
    begun = np.clip((times - 0.3) / 0.3, 0.0, 1.0)
    surge = begun * np.where(times < 2.0, -3.0, 2.0 * np.cos(1.5 * (times - 2.0)))
    sway = begun * 2.5 * np.sin(np.pi * times)
    heave = begun * 1.0 * np.sin(4.0 * np.pi * times)
    force = np.column_stack((surge, sway, heave + GRAVITY))
    rates = begun[:, None] * np.column_stack(
        (
            0.08 * np.sin(2.0 * np.pi * times),
            0.06 * np.sin(3.0 * np.pi * times),
            0.20 * np.cos(np.pi * times),
        )
    )
    return from_samples("trial", times, force, rates, np.full(len(times), 15.0))


def try_drive(
    machine: Machine, tuning: Tuning, period: float, vehicle_head: Array | None = None
) -> Trial:
    """Drive for some seconds.

    Args:
        machine: Geometry and limits.
        tuning: What starts.
        period: Planner period [s].
        vehicle_head: Driver's head from the sent point, (3,) [m].

    Raises:
        ConfigError: The algorithm cannot be made for this machine.
    """
    try:
        begun = perf_counter()
        _driven(machine, tuning, period, vehicle_head, _PROBE)
        pace = (perf_counter() - begun) / _PROBE
        length = float(np.clip(PATIENCE / max(pace, 1e-6), SHORTEST, LONGEST))
        return _driven(machine, tuning, period, vehicle_head, length)
    except ValueError as error:
        raise ConfigError(
            f"[cueing] algorithm {tuning.algorithm}",
            f"cannot drive machine {machine.name}: {error}",
            "Choose another algorithm or tuning, or correct the machine.",
        ) from error


def _driven(
    machine: Machine, tuning: Tuning, period: float, vehicle_head: Array | None, length: float
) -> Trial:
    driven = drive(
        machine,
        demanding_drive(length),
        tuning,
        rate=_RATE_HZ,
        planner_hz=1.0 / period,
        vehicle_head=vehicle_head,
    )
    periods = driven.periods
    assert periods is not None
    figures = workspace_figures(machine, driven.pose, driven.legs, 1.0 / _RATE_HZ)
    return Trial(
        tuning.algorithm,
        length,
        len(periods.times),
        periods.troubles,
        periods.rejections,
        int(np.sum(periods.kappa == 0.0)),
        int(np.sum((periods.kappa > 0.0) & (periods.kappa < 1.0))),
        figures.violations,
        int(np.sum(periods.seconds > period)),
        float(np.median(periods.seconds)),
        period,
    )


def refuse_lost(trial: Trial, machine: Machine) -> None:
    """Refuse a machine that cannot be driven.

    Raises:
        ConfigError: In too many periods nothing moves, or a limit was broken.
    """
    if trial.violations:
        raise ConfigError(
            f"machine {machine.name}",
            f"{trial.violations} samples of a drive of {trial.seconds:.1f} s broke a limit",
            "This must not happen with any machine: please report it with the machine's file.",
        )
    if trial.lost > _MOST_LOST * trial.periods:
        raise ConfigError(
            f"machine {machine.name}",
            f"in {trial.lost} of {trial.periods} periods of an off-line drive {trial.algorithm} "
            f"brought no plan that could be played ({'; '.join(_reasons(trial))})",
            "Check the machine's limits and joints and the tuning, or choose another algorithm.",
        )


def trial_lines(trial: Trial) -> list[str]:
    """The trial in words, warnings after it."""
    lost = f"{trial.lost} without a plan" if trial.lost else "each with a plan"
    lines = [
        f"drive      {trial.seconds:.1f} s off-line with {trial.algorithm}: {trial.periods} "
        f"periods, {lost}, {trial.cut} plans cut down, {trial.violations} samples beyond a limit"
    ]
    if trial.lost:
        lines.append(
            f"warning    in {trial.lost} of {trial.periods} periods the platform would play on "
            f"what it had: {'; '.join(_reasons(trial))}"
        )
    if trial.late:
        lines.append(
            f"warning    {trial.late} of {trial.periods} plans took longer here and now than the "
            f"period of {trial.period * 1e3:.1f} ms (median {trial.median * 1e3:.1f} ms): the "
            "planner would miss periods on this computer; `motionserver doctor` says why"
        )
    return lines


def _reasons(trial: Trial) -> Iterator[str]:
    for name, count in (*trial.troubles.items(), *trial.rejections.items()):
        yield f"{name}: {count}"
    if trial.stopped:
        yield f"nothing of the plan passed: {trial.stopped}"
