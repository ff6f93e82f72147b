"""Cost of the paper's programme: specific-force error, input, its change, position."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from motionserver.core.axes import Array, frozen
from motionserver.cueing.channels import CHANNELS
from motionserver.cueing.thondel_plant import STATES, Plant
from motionserver.cueing.tuning import Tuning

TIME_UNIT: Final = 0.05
"""A weight counts once per this time, whatever the grid [s]."""
CHANNEL_WEIGHT: Final = (1.0, 1.0, 0.3, 4.0)
"""Surge, sway, heave [(m/s2)-2], yaw [(rad/s)-2]: errors of different kinds against each other."""
INPUT_WEIGHT: Final = (1.0, 1.0, 0.3, 0.05)
"""The same for inputs; that of yaw is a yaw acceleration, of which turns need much."""
YAW_ANGLE_WEIGHT: Final = 0.3
"""Weight of the yaw angle against that of a position [m2/rad2]."""


@dataclass(frozen=True, slots=True)
class Cost:
    """min 1/2 U'HU + q'U with q affine in what changes.

    Attributes:
        H: (4 M, 4 M).
        from_state: (4 M, S).
        from_error: From wanted output minus known offset at the nodes, (4 M, 4 N).
        from_input: From the wanted input on each piece, (4 M, 4 M).
        from_last: From the inputs in force, (4 M, 4).
    """

    H: Array
    from_state: Array
    from_error: Array
    from_input: Array
    from_last: Array

    def linear(self, state: Array, wanted: Array, wanted_input: Array, last: Array) -> Array:
        """Linear cost q, (4 M,).

        Args:
            state: (S,).
            wanted: Wanted output minus known offsets, (4, N).
            wanted_input: (4, M).
            last: Inputs in force, (4,).
        """
        q: Array = (
            self.from_state @ state
            + self.from_error @ wanted.ravel()
            + self.from_input @ wanted_input.ravel()
            + self.from_last @ last
        )
        return q


def make_cost(plant: Plant, tuning: Tuning) -> Cost:
    """Weigh; every sum is over time, so the uneven grid does not matter.

    Args:
        plant: Condensed channels.
        tuning: Weights.
    """
    grid, moves = plant.grid, plant.moves
    count, inputs = len(grid.nodes), len(CHANNELS) * plant.moves
    share = grid.node_share / TIME_UNIT
    lengths = np.diff(grid.edges) / TIME_UNIT
    hessian = np.zeros((inputs, inputs))
    from_state = np.zeros((inputs, STATES))
    from_error = np.zeros((inputs, len(CHANNELS) * count))
    from_input = np.zeros((inputs, inputs))
    from_last = np.zeros((inputs, len(CHANNELS)))
    change = np.eye(moves) - np.eye(moves, k=-1)
    for index, channel in enumerate(CHANNELS):
        weight = CHANNEL_WEIGHT[index]
        own = slice(index * moves, (index + 1) * moves)
        output = plant.out_gamma[index][:, own]
        weighed = 2.0 * tuning.weight_force * weight * share[:, None] * output
        hessian[own, own] += output.T @ weighed
        from_state[own] += weighed.T @ plant.out_phi[index]
        from_error[own, index * count : (index + 1) * count] = -weighed.T
        for_input = np.diag(2.0 * tuning.weight_input * INPUT_WEIGHT[index] * lengths)
        hessian[own, own] += for_input
        from_input[own, own] = -for_input
        steps = np.diag(2.0 * tuning.weight_change * INPUT_WEIGHT[index] / np.maximum(lengths, 1.0))
        hessian[own, own] += change.T @ steps @ change
        from_last[own, index] = -steps[0, 0] * change[0]
        axis = channel.axes[0]
        place = plant.node_gamma[:-1, axis, own]
        unit = YAW_ANGLE_WEIGHT if channel.name == "yaw" else weight
        centred = 2.0 * tuning.weight_position * unit * share[:, None] * place
        hessian[own, own] += place.T @ centred
        from_state[own] += centred.T @ plant.node_phi[:-1, axis]
    # a solver needs strict convexity whatever the weights
    hessian += 1e-6 * np.eye(inputs)
    parts = (hessian, from_state, from_error, from_input, from_last)
    return Cost(*(frozen(part) for part in parts))
