"""How well an engine cues right now: figures of the last half minute, the same for every engine."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from motionserver.core.axes import GRAVITY, Array, frozen
from motionserver.core.kinematics.hexapod import leg_lengths
from motionserver.core.kinematics.rotation import felt
from motionserver.core.limits import Machine
from motionserver.core.plan import Plan
from motionserver.core.state import Stimulus

WINDOW: Final = 30.0
"""How far the figures look back [s]."""
SILENT: Final = 0.005
"""Rms of the wanted force below which a ratio to it says nothing [m/s2]."""
_COLUMNS: Final = 7
_FORCE, _WANTED, _KAPPA, _LEG, _TIME = slice(0, 2), slice(2, 4), 4, 5, 6
_UP: Final = np.array([0.0, 0.0, GRAVITY])


@dataclass(frozen=True, slots=True)
class Figures:
    """Figures of one engine over the window; None where there is nothing to judge.

    Attributes:
        felt: Specific force at the head minus g e_z at the newest hand-over, (3,) [m/s2].
        rest_pose: Where its newest plan ends, (6,).
        periods: Periods in the window.
        rmse: Rms of felt minus wanted force, x and y together [m/s2].
        nrmse: The same over the rms of the wanted force; 0 is perfect, 1 is no motion.
        kappa: Share of the last candidate in its plan; None without a candidate.
        whole: Share of periods with kappa = 1, of those it thought in.
        part: Share with 0 < kappa < 1.
        refused: Share with kappa = 0: nothing of the candidate passed.
        none: Share without a candidate.
        think_p50: Time to think, median [s].
        think_p99: The same, 99th percentile [s].
        leg_use: Largest distance of a leg from the middle of its stroke, as a share of the half
            stroke.
    """

    felt: Array
    rest_pose: Array
    periods: int
    rmse: float | None
    nrmse: float | None
    kappa: float | None
    whole: float | None
    part: float | None
    refused: float | None
    none: float | None
    think_p50: float | None
    think_p99: float | None
    leg_use: float


class Scores:
    """A ring of periods.

    In every period: `heard`, then `thought` unless the period was skipped. What was felt at the
    hand-over of one period is compared with what is wanted in the next, the instant at which it is
    felt; so an engine is judged for its cueing, and neither for the link nor for the computer.

    Args:
        machine: For the head and the legs.
        period: Planner period [s].
    """

    def __init__(self, machine: Machine, period: float) -> None:
        self._machine = machine
        self._half = 0.5 * (machine.leg_max - machine.leg_min)
        self._middle = 0.5 * (machine.leg_max + machine.leg_min)
        self._rows = np.full((max(1, round(WINDOW / period)), _COLUMNS), np.nan)
        self._every = max(1, round(0.25 / period))
        self._count = 0
        self._at = -1
        self._shown: Figures | None = None
        self.pause()
        self.felt: Array = frozen(np.zeros(3))
        self.rest_pose: Array = frozen(np.zeros(6))
        self.kappa: float | None = None

    def pause(self) -> None:
        """No period follows directly on the last one: nothing felt is compared with the next."""
        self._before: Array | None = None

    def heard(self, plan: Plan, takeover: float, stimulus: Stimulus) -> None:
        """Begin a period.

        Args:
            plan: The plan in force.
            takeover: Hand-over in its own time [s].
            stimulus: What is wanted now.
        """
        state = plan.state(takeover)
        force = felt(state.pose, state.velocity, state.acceleration, self._machine.head)[0] - _UP
        legs = leg_lengths(self._machine, state.pose)
        self._at = (self._at + 1) % len(self._rows)
        self._count += 1
        row = self._rows[self._at]
        row[:] = np.nan
        row[_LEG] = np.max(np.abs(legs - self._middle)) / self._half
        if self._before is not None:
            row[_FORCE], row[_WANTED] = self._before[:2], stimulus.force[:2]
        self._before = force
        self.felt, self.rest_pose = frozen(force), plan.rest_pose

    def thought(self, kappa: float | None, seconds: float) -> None:
        """Note what came of the period.

        Args:
            kappa: Share of the candidate in the plan; None without a candidate.
            seconds: How long it thought [s].
        """
        self.kappa = kappa
        self._rows[self._at, _KAPPA] = -1.0 if kappa is None else kappa
        self._rows[self._at, _TIME] = seconds

    def figures(self) -> Figures:
        """The figures, put together four times a second at most; what is felt is of now."""
        if self._shown is None or self._count % self._every == 0:
            self._shown = self._judged()
        return replace(self._shown, felt=self.felt, rest_pose=self.rest_pose, kappa=self.kappa)

    def _judged(self) -> Figures:
        rows = self._rows[: min(self._count, len(self._rows))]
        judged = rows[np.isfinite(rows[:, 0])]
        thought = rows[np.isfinite(rows[:, _KAPPA])]
        kappa, times = thought[:, _KAPPA], thought[:, _TIME]
        rmse = nrmse = None
        if len(judged):
            rmse = _rms(judged[:, _FORCE] - judged[:, _WANTED])
            wanted = _rms(judged[:, _WANTED])
            nrmse = rmse / wanted if wanted >= SILENT else None

        def share(which: Array) -> float | None:
            return float(np.mean(which)) if len(thought) else None

        return Figures(
            self.felt,
            self.rest_pose,
            len(rows),
            rmse,
            nrmse,
            self.kappa,
            share(kappa == 1.0),
            share((kappa > 0.0) & (kappa < 1.0)),
            share(kappa == 0.0),
            share(kappa < 0.0),
            float(np.median(times)) if len(times) else None,
            float(np.quantile(times, 0.99)) if len(times) else None,
            float(np.max(rows[:, _LEG])) if len(rows) else 0.0,
        )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
