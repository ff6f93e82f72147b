"""The paper's programme put together: cost, soft rows, leg rows, one solve per tick."""

from __future__ import annotations

import numpy as np

from motionserver.core.axes import Array, frozen
from motionserver.core.limits import Machine
from motionserver.cueing.stopping import STOP_TIME
from motionserver.cueing.thondel_cost import Cost, make_cost
from motionserver.cueing.thondel_legs import leg_rows, margins_over, way_home_gains, with_way_home
from motionserver.cueing.thondel_plant import Plant
from motionserver.cueing.thondel_rows import LARGEST_INPUT, LEG_UNIT, Layout, Rows, make_rows
from motionserver.cueing.tuning import Tuning
from motionserver.solvers.base import QpBackend, QpMatrices, QpResult, QpVectors
from motionserver.solvers.registry import make_backend


class Programme:
    """Quadratic programme of all four channels on one plant.

    Args:
        machine: Geometry and limits.
        plant: Condensed channels.
        tuning: Weights, thresholds, box, backend.

    Attributes:
        looks: Instants at which poses are bounded, the last one at rest, (N + 1,) [s].
        layout: Where each variable stands.
    """

    layout: Layout
    _cost: Cost
    _rows: Rows
    _backend: QpBackend

    def __init__(self, machine: Machine, plant: Plant, tuning: Tuning) -> None:
        self._machine, self._plant = machine, plant
        instants = plant.grid.knots[plant.grid.nodes]
        self.looks = frozen(np.append(instants, instants[-1] + STOP_TIME))
        self._margins = margins_over(self.looks)
        self._leg_gamma = frozen(way_home_gains(plant.node_gamma) / LEG_UNIT)
        self._shape: tuple[object, ...] = ()
        self.weigh(tuning)

    def weigh(self, tuning: Tuning) -> None:
        """Take other weights, thresholds or box; the solver is kept where the size allows it."""
        rows = make_rows(self._plant, tuning)
        shape = (tuning.backend, tuning.legs, rows.layout.size)
        if shape != self._shape:
            # first of all, since this may fail
            self._backend = make_backend(tuning.backend)
            self._shape = shape
        self._tuning = tuning
        self._cost = make_cost(self._plant, tuning)
        self._rows = rows
        self.layout = layout = rows.layout
        hessian = np.diag(self._rows.curvature)
        hessian[: layout.inputs, : layout.inputs] += self._cost.H
        self._hessian = frozen(hessian)
        slacks = layout.size - layout.inputs
        inputs = np.full(layout.inputs, LARGEST_INPUT)
        self._lowest = np.concatenate((-inputs, np.zeros(slacks)))
        self._highest = np.concatenate((inputs, np.full(slacks, np.inf)))
        self._box_slack = np.tile(np.arange(6) + layout.box.start, len(self.looks))
        # near neutral either end may come first, so both stand
        sides = [self._box_rows(side) for side in (1.0, -1.0)]
        self._constant = QpMatrices(self._hessian, np.concatenate((self._rows.A, *sides)))
        self._handed_over = False

    @property
    def tuning(self) -> Tuning:
        """The tuning whose weights, thresholds and box are in force."""
        return self._tuning

    @property
    def backend(self) -> str:
        """Name of the solver in use."""
        return self._backend.name

    def solve(
        self,
        state: Array,
        aim: Array,
        input_aim: Array,
        last: Array,
        turned: Array,
        nominal: Array,
        x_max: Array,
    ) -> QpResult:
        """Find U and slacks.

        Args:
            state: States of the channels, (S,).
            aim: Wanted outputs minus known offsets at the nodes, (4, N).
            input_aim: Wanted inputs, (4, M).
            last: Inputs in force, (4,).
            turned: The vehicle's own rotation at `looks`, (N + 1, 6).
            nominal: Remainder of the accepted plan at `looks`, (N + 1, 6).
            x_max: Position limits in force, (6,).
        """
        layout = self.layout
        q = self._rows.penalty.copy()
        q[: layout.inputs] = self._cost.linear(state, aim, input_aim, last)
        free = self._plant.node_phi @ state + turned
        rates = 1.0 - self._rows.state @ state
        share = np.tile(x_max / self._tuning.box, len(free))
        place = (free / self._tuning.box).ravel()
        upper = np.concatenate((rates, share - place, share + place))
        matrices = None if self._handed_over else self._constant
        if self._tuning.legs:
            table, room = self._leg_rows(free, nominal)
            upper = np.concatenate((upper, room))
            matrices = QpMatrices(self._hessian, np.concatenate((self._constant.A, table)))
        self._handed_over = True
        lower = np.full(len(upper), -np.inf)
        vectors = QpVectors(q, lower, upper, self._lowest, self._highest)
        return self._backend.solve(vectors, matrices)

    def _leg_rows(self, free: Array, nominal: Array) -> tuple[Array, Array]:
        """Rows about the nominal and what they may be, in `LEG_UNIT`."""
        layout, home = self.layout, self._machine.parked_pose
        legs = leg_rows(self._machine, with_way_home(nominal, home), self._margins)
        table = np.zeros((legs.room.size, layout.size))
        table[:, : layout.inputs] = np.matmul(legs.gradient, self._leg_gamma).reshape(
            -1, layout.inputs
        )
        table[:, layout.leg] = -1.0
        room = legs.room - np.einsum("nla,na->nl", legs.gradient, with_way_home(free, home))
        return table, room.ravel() / LEG_UNIT

    def _box_rows(self, side: float) -> Array:
        table = np.zeros((len(self._box_slack), self.layout.size))
        table[:, : self.layout.inputs] = side * self._rows.box
        table[np.arange(len(table)), self._box_slack] = -1.0
        return table
