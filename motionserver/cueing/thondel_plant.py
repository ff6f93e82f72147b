"""The four washout channels condensed onto one grid: pose tables as maps of state and inputs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from motionserver.core.axes import GRAVITY, Array, frozen
from motionserver.core.state import PlatformState
from motionserver.cueing.channels import CHANNELS
from motionserver.cueing.filters import FilterSet
from motionserver.cueing.horizon import Grid, condense
from motionserver.cueing.stopping import STOP_TIME, rest_gains

STATES = sum(channel.size for channel in CHANNELS)
"""States of all channels, one after the other."""


@dataclass(frozen=True, slots=True)
class Plant:
    """All channels together. M moves each; U is (4 M,), channel after channel.

    Attributes:
        grid: Pieces, knots, nodes.
        moves: M.
        phi: Pose, velocity, acceleration at the knots from the state, (3, K, 6, S).
        gamma: The same from U, (3, K, 6, 4 M).
        node_phi: Pose at the nodes and at rest after them from the state, (N + 1, 6, S).
        node_gamma: The same from U, (N + 1, 6, 4 M).
        out_phi: Output of each channel at the nodes from the state, (4, N, S).
        out_gamma: The same from U, (4, N, 4 M).
    """

    grid: Grid
    moves: int
    phi: Array
    gamma: Array
    node_phi: Array
    node_gamma: Array
    out_phi: Array
    out_gamma: Array


def make_plant(filters: FilterSet, grid: Grid, head: Array) -> Plant:
    """Condense every channel.

    Outputs: f_x = x'' + g phi - r_z phi'' for surge with pitch, likewise for sway with roll (the
    head's height r_z works the same way in both, since pitch is -phi); z'' for heave; psi' for yaw.

    Args:
        filters: Corners.
        grid: Pieces, knots, nodes.
        head: Driver's head from the reference point, (3,) [m].
    """
    moves, count = len(grid.edges) - 1, len(grid.knots)
    inputs = len(CHANNELS) * moves
    phi = np.zeros((3, count, 6, STATES))
    gamma = np.zeros((3, count, 6, inputs))
    out_phi = np.zeros((len(CHANNELS), len(grid.nodes), STATES))
    out_gamma = np.zeros((len(CHANNELS), len(grid.nodes), inputs))
    first = 0
    for index, channel in enumerate(CHANNELS):
        block = channel.block(filters)
        condensed = condense(block, grid)
        states = slice(first, first + channel.size)
        own = slice(index * moves, (index + 1) * moves)
        for triple, (axis, sign) in enumerate(zip(channel.axes, channel.signs, strict=True)):
            for order in range(3):
                phi[order, :, axis, states] = sign * condensed.phi[:, 3 * triple + order]
                gamma[order, :, axis, own] = sign * condensed.gamma[:, 3 * triple + order]
        if len(channel.axes) == 2:
            row = np.array([0.0, 0.0, 1.0, GRAVITY, 0.0, -head[2]])
        elif channel.name == "heave":
            row = np.array([0.0, 0.0, 1.0])
        else:
            row = np.array([0.0, 1.0, 0.0])
        out_phi[index, :, states] = row @ condensed.phi[grid.nodes]
        out_gamma[index, :, own] = row @ condensed.gamma[grid.nodes]
        first += channel.size
    rest = rest_gains(STOP_TIME)
    end_phi, end_gamma = (np.tensordot(rest, table[:, -1], 1) for table in (phi, gamma))
    return Plant(
        grid,
        moves,
        frozen(phi),
        frozen(gamma),
        frozen(np.concatenate((phi[0, grid.nodes], end_phi[None]))),
        frozen(np.concatenate((gamma[0, grid.nodes], end_gamma[None]))),
        frozen(out_phi),
        frozen(out_gamma),
    )


def stacked_state(tilt_only: PlatformState) -> Array:
    """State of all channels, (S,), of a platform state without the vehicle's own rotation."""
    return np.concatenate([channel.state(tilt_only) for channel in CHANNELS])
