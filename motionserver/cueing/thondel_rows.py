"""Constant rows of the programme: tilt rate, tilt acceleration, box; all soft by exact penalty.

Variables z = [U (4 M), slack of tilt rate (2 M), slack of each box axis (6), leg slack (1), and,
only with a weight for it, slack of tilt acceleration (2)]. Rows are divided by their bounds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from motionserver.core.axes import Array, Axis, frozen
from motionserver.cueing.channels import CHANNELS
from motionserver.cueing.thondel_plant import Plant
from motionserver.cueing.tuning import Tuning

LARGEST_INPUT: Final = 8.0
"""|U| of every channel [m/s2, rad/s2]."""
TILT_AXES: Final = (Axis.PITCH, Axis.ROLL)
RATE_PENALTY: Final = (20.0, 20.0)
"""Linear and quadratic penalty of tilt rate beyond its threshold, per piece, as a share of it."""
BOX_PENALTY: Final = (200.0, 200.0)
"""Of leaving the box, as a share of it."""
LEG_PENALTY: Final = (1000.0, 1000.0)
"""Of leaving the legs' stroke, in `LEG_UNIT`."""
LEG_UNIT: Final = 0.1
"""Leg rows are divided by this [m]."""


@dataclass(frozen=True, slots=True)
class Layout:
    """Where each variable stands.

    Attributes:
        inputs: Number of inputs, 4 M; they come first.
        rate: Slack of tilt rate.
        box: Slack of the box, by axis.
        leg: Slack of the legs.
        acceleration: Slack of tilt acceleration; empty without it.
        size: Number of variables.
    """

    inputs: int
    rate: slice
    box: slice
    leg: int
    acceleration: slice
    size: int


def make_layout(moves: int, with_acceleration: bool) -> Layout:
    """Place the variables."""
    inputs = len(CHANNELS) * moves
    rate = inputs + 2 * moves
    leg = rate + 6
    size = leg + 1 + (2 if with_acceleration else 0)
    return Layout(inputs, slice(inputs, rate), slice(rate, leg), leg, slice(leg + 1, size), size)


@dataclass(frozen=True, slots=True)
class Rows:
    """Rows that do not depend on the nominal plan.

    Attributes:
        layout: Variables.
        A: Tilt rate (and acceleration) rows, both sides, (R, n).
        state: What the state adds to the left side, (R, S).
        rotation: Not here: the vehicle's own rotation is not bound by these.
        box: Box rows of the upper side without slack, ((N + 1) 6, 4 M), divided by X_M.
        penalty: Linear cost of every variable, (n,).
        curvature: Diagonal added to H, (n,).
    """

    layout: Layout
    A: Array
    state: Array
    box: Array
    penalty: Array
    curvature: Array


def make_rows(plant: Plant, tuning: Tuning) -> Rows:
    """Build them.

    Args:
        plant: Condensed channels.
        tuning: Thresholds, box.
    """
    layout = make_layout(plant.moves, tuning.tilt_acceleration_weight > 0.0)
    nodes, piece = plant.grid.nodes, plant.grid.node_piece
    rows: list[Array] = []
    states: list[Array] = []
    demands = [(1, tuning.tilt_rate)]
    if tuning.tilt_acceleration_weight > 0.0:
        demands.append((2, tuning.tilt_acceleration))
    for order, bound in demands:
        for index, axis in enumerate(TILT_AXES):
            table = np.zeros((len(nodes), layout.size))
            table[:, : layout.inputs] = plant.gamma[order, nodes, axis] / bound
            state = plant.phi[order, nodes, axis] / bound
            for sign in (1.0, -1.0):
                signed = sign * table
                if order == 1:
                    column = layout.rate.start + index * plant.moves + piece
                    signed[np.arange(len(nodes)), column] = -1.0
                else:
                    signed[:, layout.acceleration.start + index] = -1.0
                rows.append(signed)
                states.append(sign * state)
    penalty, curvature = np.zeros(layout.size), np.zeros(layout.size)
    for where, (linear, quadratic) in (
        (layout.rate, RATE_PENALTY),
        (layout.box, BOX_PENALTY),
        (slice(layout.leg, layout.leg + 1), LEG_PENALTY),
        (layout.acceleration, (tuning.tilt_acceleration_weight,) * 2),
    ):
        penalty[where], curvature[where] = linear, 2.0 * quadratic
    box = plant.node_gamma / tuning.box[None, :, None]
    return Rows(
        layout,
        frozen(np.concatenate(rows)),
        frozen(np.concatenate(states)),
        frozen(box.reshape(-1, layout.inputs)),
        frozen(penalty),
        frozen(curvature),
    )
