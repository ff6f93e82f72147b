"""The uneven grid of a horizon, and a linear system condensed onto it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from motionserver.core.axes import Array, frozen
from motionserver.cueing.filters import Block, discretise

LARGEST_GROWTH: Final = 1.5
"""A piece is at most this much longer than the one before; more costs the onset cue."""
FEWEST_MOVES: Final = 4


@dataclass(frozen=True, slots=True)
class Grid:
    """Pieces of constant input, and the instants looked at.

    Attributes:
        edges: Ends of the pieces, edges[0] = 0, (M + 1,) [s].
        knots: Instants at which a plan has knots, without 0, (K,) [s].
        nodes: Index of the knots at which the programme looks, (N,).
        node_piece: Piece each node lies in (or ends), (N,).
        node_share: Time each node stands for, (N,) [s].
    """

    edges: Array
    knots: Array
    nodes: np.ndarray
    node_piece: np.ndarray
    node_share: Array


def make_grid(horizon: float, period: float, finest: float = 0.04, node: float = 0.22) -> Grid:
    """Cut a horizon into pieces: two of one period, then growing evenly.

    Args:
        horizon: Its length [s].
        period: Planner period [s].
        finest: Longest distance of knots in the first half second, doubled after [s].
        node: Longest distance of nodes [s].
    """
    lengths = _lengths(horizon, period)
    edges = np.concatenate(([0.0], np.cumsum(lengths)))
    knots: list[float] = []
    nodes: list[int] = []
    pieces: list[int] = []
    for piece, length in enumerate(lengths):
        begin = edges[piece]
        looks = int(np.ceil(length / node))
        spacing = finest if begin < 0.5 else 2.0 * finest
        per_look = int(np.ceil(length / looks / spacing))
        count = looks * per_look
        for index in range(1, count + 1):
            knots.append(begin + length * index / count)
            if index % per_look == 0:
                nodes.append(len(knots) - 1)
                pieces.append(piece)
    instants = np.array(knots)
    share = np.diff(np.concatenate(([0.0], instants[nodes])))
    return Grid(frozen(edges), frozen(instants), np.array(nodes), np.array(pieces), frozen(share))


def _lengths(horizon: float, period: float) -> Array:
    """Lengths of the pieces [s]: one period twice, then growing by one factor <= 1.5."""
    count = FEWEST_MOVES
    while True:
        low, high = 1.0, LARGEST_GROWTH
        if period * (1.0 + np.sum(high ** np.arange(count - 1))) < horizon:
            count += 1
            continue
        for _ in range(60):
            middle = 0.5 * (low + high)
            reach = period * (1.0 + np.sum(middle ** np.arange(count - 1)))
            low, high = (middle, high) if reach < horizon else (low, middle)
        pieces: Array = period * np.concatenate(([1.0], high ** np.arange(count - 1)))
        return pieces


@dataclass(frozen=True, slots=True)
class Condensed:
    """States at the knots as maps of the first state and the inputs.

    x(knots[k]) = phi[k] x0 + gamma[k] U.

    Attributes:
        phi: (K, n, n).
        gamma: (K, n, M).
    """

    phi: Array
    gamma: Array


def condense(block: Block, grid: Grid) -> Condensed:
    """Eliminate the states of ``block`` under an input constant on each piece."""
    size, moves = len(block.A), len(grid.edges) - 1
    phi = np.zeros((len(grid.knots), size, size))
    gamma = np.zeros((len(grid.knots), size, moves))
    free, forced = np.eye(size), np.zeros((size, moves))
    before = 0.0
    known: dict[int, tuple[Array, Array]] = {}
    for index, instant in enumerate(grid.knots):
        step = float(instant) - before
        # to the nanosecond: equal steps share their exponential
        key = round(step * 1e9)
        if key not in known:
            known[key] = discretise(block, step)
        move, push = known[key]
        piece = min(int(np.searchsorted(grid.edges, instant - 1e-9)) - 1, moves - 1)
        free, forced = move @ free, move @ forced
        forced[:, piece] += push
        phi[index], gamma[index] = free, forced
        before = float(instant)
    return Condensed(frozen(phi), frozen(gamma))
