"""What the programme linearises about: the accepted plan's rest, projected onto the grid.

Adding increments to the shifted plan itself would let wiggles between the nodes pile up; the
projection has the same start, ends at rest at the same pose, and lies on the grid exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from motionserver.core.axes import Array, frozen
from motionserver.core.plan import Plan
from motionserver.core.state import PlatformState
from motionserver.cueing.mpc_grid import SplineGrid, jerk_maps

SAMPLES_PER_PIECE: Final = 3
_LIKE_VELOCITY: Final = 4.0
"""Weight of a velocity error [1/s2] where an acceleration error weighs 1."""
_LIKE_POSE: Final = 16.0
"""Weight of a pose error [1/s4]."""


@dataclass(frozen=True, slots=True)
class Nominal:
    """A motion on the grid.

    Attributes:
        jerks: (M, 6).
        pose: At the nodes, (N, 6).
        velocity: (N, 6).
        acceleration: (N, 6).
    """

    jerks: Array
    pose: Array
    velocity: Array
    acceleration: Array


class Projection:
    """Least squares in acceleration, velocity and pose, under the conditions at both ends."""

    def __init__(self, grid: SplineGrid) -> None:
        self._grid = grid
        pieces, horizon = grid.pieces, grid.horizon
        share = (np.arange(SAMPLES_PER_PIECE) + 0.5) / SAMPLES_PER_PIECE
        lengths = np.diff(grid.edges)
        self._times = (grid.edges[:-1, None] + share * lengths[:, None]).ravel()
        weight = np.repeat(lengths / SAMPLES_PER_PIECE, SAMPLES_PER_PIECE)
        maps, end = jerk_maps(grid.edges, self._times), jerk_maps(grid.edges, grid.edges[-1:])
        t, ones = self._times, np.ones_like(self._times)
        # what is fitted: the samples minus the motion without jerk
        free = (
            np.stack((ones, t, t**2 / 2.0), 1),
            np.stack((0.0 * t, ones, t), 1),
            np.stack((0.0 * t, 0.0 * t, ones), 1),
        )
        hessian = np.zeros((pieces, pieces))
        linear = np.zeros((pieces, 4 + 3 * len(t)))
        parts = (
            (maps.pose, _LIKE_POSE, free[0]),
            (maps.velocity, _LIKE_VELOCITY, free[1]),
            (maps.acceleration, 1.0, free[2]),
        )
        for order, (gain, like, known) in enumerate(parts):
            weighted = (gain * (like * weight)[:, None]).T
            hessian += weighted @ gain
            columns = slice(4 + order * len(t), 4 + (order + 1) * len(t))
            linear[:, columns] += weighted
            linear[:, :3] -= weighted @ known
        rules = np.concatenate((end.pose, end.velocity, end.acceleration))
        wanted = np.zeros((3, linear.shape[1]))
        wanted[0, :4] = (-1.0, -horizon, -(horizon**2) / 2.0, 1.0)
        wanted[1, 1:3] = (-1.0, -horizon)
        wanted[2, 2] = -1.0
        kkt = np.block([[hessian, rules.T], [rules, np.zeros((3, 3))]])
        self._gain: Array = np.linalg.solve(kkt, np.concatenate((linear, wanted)))[:pieces]
        nodes = jerk_maps(grid.edges, grid.nodes)
        n, still = grid.nodes, np.ones_like(grid.nodes)
        bases = (
            np.stack((still, n, n**2 / 2.0), 1),
            np.stack((0.0 * n, still, n), 1),
            np.stack((0.0 * n, 0.0 * n, still), 1),
        )
        gains = (nodes.pose, nodes.velocity, nodes.acceleration)
        self._lay: Array = frozen(
            np.concatenate([np.hstack(pair) for pair in zip(bases, gains, strict=True)])
        )

    def of(self, start: PlatformState, parent: Plan, takeover: float) -> Nominal:
        """Project the rest of ``parent`` from ``takeover`` [s] on, where it is in ``start``."""
        samples = parent.evaluate(takeover + self._times)
        begin = np.stack((start.pose, start.velocity, start.acceleration))
        known = np.concatenate((begin, parent.rest_pose[None], *samples))
        jerks = self._gain @ known
        laid = self._lay @ np.concatenate((begin, jerks))
        count = len(self._grid.nodes)
        return Nominal(jerks, laid[:count], laid[count : 2 * count], laid[2 * count :])
