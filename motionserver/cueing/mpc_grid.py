"""Plans of the six-axis MPC: pieces of constant jerk that always end at rest.

On an uneven grid of M pieces the jerks of one axis that leave speed and acceleration zero at the
end are spanned by M - 2 combinations of three neighbouring pieces (integrated cubic B-splines).
Added to any plan that ends at rest they give another one: hand-over and rest are exact by
construction, and all maps are constant.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import ceil
from typing import Final

import numpy as np

from motionserver.core.axes import Array, frozen
from motionserver.core.state import PlatformState
from motionserver.errors import TunableError

PIECES: Final = 15
FEWEST: Final = 6
"""Fewer pieces leave no freedom worth solving for."""
GROWTH_POWER: Final = 1.5
"""How the pieces grow after the first two: 1 + c k^1.5 periods."""
LONGEST_LOOK: Final = 0.1
"""Longest distance of nodes within a piece [s]; twice that in the second half."""


@dataclass(frozen=True, slots=True)
class Maps:
    """Effect of jerks on one axis at some instants: each (N, columns)."""

    pose: Array
    velocity: Array
    acceleration: Array

    def of(self, jerks: Array) -> Maps:
        """The same of combinations of jerks, (M, columns)."""
        return Maps(self.pose @ jerks, self.velocity @ jerks, self.acceleration @ jerks)


@dataclass(frozen=True, eq=False)
class SplineGrid:
    """The grid and its constant maps.

    Attributes:
        edges: Ends of the pieces, edges[0] = 0, (M + 1,) [s].
        nodes: Instants the programme looks at, every edge but 0 among them, (N,) [s].
        knots: Index of each edge but 0 among the nodes, (M,).
        share: Time each node stands for, (N,) [s].
        piece: Piece in which each node lies (or which it ends), (N,).
    """

    edges: Array
    nodes: Array
    knots: np.ndarray
    share: Array
    piece: np.ndarray

    @property
    def pieces(self) -> int:
        """Number of pieces M."""
        return len(self.edges) - 1

    @property
    def horizon(self) -> float:
        """Where every plan is at rest [s]."""
        return float(self.edges[-1])

    @cached_property
    def basis(self) -> Array:
        """Jerks of each combination, (M, M - 2), scaled to a peak acceleration of 1."""
        out = np.zeros((self.pieces, self.pieces - 2))
        for first in range(self.pieces - 2):
            three = slice(first, first + 3)
            end = jerk_maps(self.edges, self.edges[first + 3 : first + 4])
            rows = np.concatenate((end.velocity[:, three], end.acceleration[:, three]))
            jerks = np.cross(rows[0], rows[1])
            reached = np.cumsum(jerks * np.diff(self.edges)[three])
            out[three, first] = jerks / np.abs(reached).max()
        return frozen(out)

    @cached_property
    def at_nodes(self) -> Maps:
        """Effect of the combinations at the nodes."""
        return jerk_maps(self.edges, self.nodes).of(self.basis)

    def free(self, state: PlatformState, times: Array) -> tuple[Array, Array, Array]:
        """Motion without jerk from ``state``: pose, velocity, acceleration, each (N, 6)."""
        t = times[:, None]
        return (
            state.pose + t * state.velocity + 0.5 * t**2 * state.acceleration,
            state.velocity + t * state.acceleration,
            np.broadcast_to(state.acceleration, (len(times), 6)),
        )


def jerk_maps(edges: Array, times: Array) -> Maps:
    """Effect of a unit jerk on each piece (M) at ``times`` (N,): maps (N, M)."""
    begins, ends = edges[:-1], edges[1:]
    inside = np.clip(times[:, None], begins, ends) - begins
    after = np.maximum(times[:, None] - ends, 0.0)
    velocity = inside**2 / 2.0 + inside * after
    pose = inside**3 / 6.0 + inside**2 / 2.0 * after + inside * after**2 / 2.0
    return Maps(pose, velocity, inside)


def make_spline_grid(horizon: float, period: float, pieces: int = PIECES) -> SplineGrid:
    """Cut a horizon into pieces: two of one period, then growing.

    Args:
        horizon: Where plans end [s].
        period: Planner period [s].
        pieces: How many; at least `FEWEST`.

    Raises:
        ValueError: Too few pieces, or more than fit into the horizon.
    """
    if pieces < FEWEST or pieces * period > horizon:
        raise TunableError(
            "horizon",
            f"six-axis MPC: {pieces} pieces do not fit; allowed {FEWEST} to "
            f"{int(horizon / period)} for a horizon of {horizon:g} s and a period of {period:g} s",
            f"at least {max(pieces, FEWEST) * period:.3g} s with {pieces} pieces",
        )
    powers = np.maximum(np.arange(pieces) - 1.0, 0.0) ** GROWTH_POWER
    growth = (horizon / period - pieces) / powers.sum()
    lengths = period * (1.0 + growth * powers)
    edges = np.concatenate(([0.0], np.cumsum(lengths)))
    edges[-1] = horizon
    nodes: list[float] = []
    knots: list[int] = []
    piece: list[int] = []
    for index, (begin, length) in enumerate(zip(edges, np.diff(edges), strict=False)):
        look = LONGEST_LOOK if begin < horizon / 2.0 else 2.0 * LONGEST_LOOK
        count = ceil(length / look - 0.2)
        count = max(1, count)
        nodes += [begin + length * k / count for k in range(1, count + 1)]
        piece += [index] * count
        knots.append(len(nodes) - 1)
    instants = np.array(nodes)
    instants[knots] = edges[1:]
    padded = np.concatenate(([0.0], instants, instants[-1:]))
    share = 0.5 * (padded[2:] - padded[:-2])
    return SplineGrid(
        frozen(edges), frozen(instants), np.array(knots), frozen(share), np.array(piece)
    )
