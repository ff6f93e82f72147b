"""Where the nominal's legs are between the nodes: the extremes of each stretch.

Rows stand at nodes; what the nominal does between them is known exactly, so each row's bound starts
from the worst value of the stretches that adjoin its node.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from motionserver.core.axes import Array, frozen
from motionserver.core.kinematics.hexapod import leg_lengths
from motionserver.core.limits import Machine
from motionserver.cueing.mpc_grid import SplineGrid, jerk_maps

FINE: Final = 0.25
"""Spacing of the early samples, in periods: speed, acceleration and jerk are seen there."""
COARSE: Final = 0.02
"""Spacing of the later ones [s]: length and speed only."""


@dataclass(frozen=True, slots=True)
class Extremes:
    """Largest and smallest value in each stretch, ending at each node: (S, 6 legs)."""

    high: Array
    low: Array

    def around(self, ends: np.ndarray) -> Extremes:
        """Of the stretches that end and begin at the nodes ``ends``."""
        after = np.minimum(ends + 1, len(self.high) - 1)
        return Extremes(
            np.maximum(self.high[ends], self.high[after]),
            np.minimum(self.low[ends], self.low[after]),
        )


@dataclass(frozen=True, slots=True)
class LegExtremes:
    """Of length and speed over the horizon; of acceleration and jerk in the early part."""

    length: Extremes
    speed: Extremes
    acceleration: Extremes
    jerk: Extremes


class NominalLegs:
    """Samples the nominal's legs and finds their extremes.

    Args:
        machine: Geometry.
        grid: The grid of plans.
        period: Planner period [s].
        early: Until when acceleration and jerk matter [s].
    """

    def __init__(self, machine: Machine, grid: SplineGrid, period: float, early: float) -> None:
        self._machine = machine
        self._step = FINE * period
        self._early = int(np.ceil(early / self._step)) + 3
        begin = (self._early - 1) * self._step
        later = max(2, int(np.ceil((grid.horizon - begin) / COARSE)))
        self._later_step = (grid.horizon - begin) / later
        times = np.concatenate(
            (
                np.arange(self._early) * self._step,
                begin + self._later_step * np.arange(1, later + 1),
            )
        )
        maps = jerk_maps(grid.edges, times)
        free = np.stack((np.ones_like(times), times, times**2 / 2.0), 1)
        self._lay = frozen(np.hstack((free, maps.pose)))
        fine, late = times[: self._early], times[self._early - 1 :]
        midway = 0.5 * (fine[:-1] + fine[1:])
        near = grid.nodes[grid.nodes <= early]
        self._splits = (
            _splits(grid.nodes, times),
            _splits(grid.nodes, np.concatenate((midway, 0.5 * (late[:-1] + late[1:])))),
            _splits(near, fine[1:-1]),
            _splits(near, 0.5 * (midway[:-2] + midway[2:])),
        )

    def of(self, begin: Array, jerks: Array) -> LegExtremes:
        """Extremes under ``jerks`` (M, 6) from the pose, velocity, acceleration (3, 6)."""
        poses = self._lay @ np.concatenate((begin, jerks))
        legs = leg_lengths(self._machine, poses)
        fine = legs[: self._early]
        speed = np.diff(fine, axis=0) / self._step
        acceleration = np.diff(speed, axis=0) / self._step
        jerk = np.diff(acceleration, axis=0) / self._step
        later = np.diff(legs[self._early - 1 :], axis=0) / self._later_step
        values = (legs, np.concatenate((speed, later)), acceleration, jerk)
        return LegExtremes(
            *(
                Extremes(
                    np.maximum.reduceat(value, splits, axis=0),
                    np.minimum.reduceat(value, splits, axis=0),
                )
                for value, splits in zip(values, self._splits, strict=True)
            )
        )


def _splits(ends: Array, times: Array) -> np.ndarray:
    """First sample of each stretch between ``ends``, for `reduceat`."""
    begins = np.concatenate(([-1.0], ends[:-1]))
    found = np.searchsorted(times, begins + 1e-9)
    return np.minimum(found, len(times) - 1)
