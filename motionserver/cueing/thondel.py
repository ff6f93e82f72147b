"""Motion cueing by model predictive control after Thoendel (ECMS 2014), on four channels.

Every channel keeps the paper's form: one input U drives a high-pass to the platform's position and
a low-pass to its tilt (equation 5); the controller scales and shapes U. Limits are the platform's
box (Table 2), the threshold of tilt rate (Table 1, soft) and, beyond the paper, the legs' stroke.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from motionserver.core.axes import GRAVITY, Array, Axis, frozen
from motionserver.core.limits import Machine
from motionserver.core.plan import Plan
from motionserver.core.state import PlatformState, Stimulus
from motionserver.cueing.base import Candidate, Report
from motionserver.cueing.channels import minus
from motionserver.cueing.filters import filter_set
from motionserver.cueing.halving import make_halving
from motionserver.cueing.horizon import make_grid
from motionserver.cueing.reference import Reference
from motionserver.cueing.rotation import RotationPart
from motionserver.cueing.stopping import STOP_TIME, with_stop
from motionserver.cueing.thondel_cost import make_cost
from motionserver.cueing.thondel_legs import leg_rows, margins_over
from motionserver.cueing.thondel_plant import make_plant, stacked_state
from motionserver.cueing.thondel_rows import LARGEST_INPUT, LEG_UNIT, make_rows
from motionserver.cueing.tuning import Tuning
from motionserver.solvers.base import QpMatrices, QpStatus, QpVectors
from motionserver.solvers.registry import make_backend

YAW_CORNER: Final = 0.5
"""High-pass of the wanted yaw rate [rad/s]."""
LARGEST_DISTURBANCE: Final = 0.3
"""Bound of the estimated output disturbance [m/s2]."""
SIGNALS: Final = (0, 1, 2, 5)
"""Reference signal of each channel: f_x, f_y, f_z, r."""


class Thondel:
    """The algorithm ``thondel2014``.

    Args:
        machine: Geometry and limits.
        tuning: Tunables.
        period: Planner period; the hand-over is one period ahead [s].

    Attributes:
        disturbance: Estimated specific force nobody planned, (3,) [m/s2]; set from outside.
    """

    name = "thondel2014"

    def __init__(self, machine: Machine, tuning: Tuning, period: float) -> None:
        self._machine, self._period = machine, period
        self.disturbance: Array = np.zeros(3)
        self._last = np.zeros(4)
        self._slow_yaw = 0.0
        self._trouble = False
        self._pending: tuple[Array, Array, PlatformState, float] | None = None
        self._build(tuning)
        self._report = Report(frozen(self._halving.x_max))

    def retune(self, tuning: Tuning) -> None:
        """Take other tunables; cheap unless filters, horizon, reference or backend change."""
        old = self._tuning
        if (old.filters, old.horizon) != (tuning.filters, tuning.horizon):
            self._build(tuning)
            return
        if old.reference != tuning.reference:
            self._reference = self._make_reference(tuning)
        if old.halving != tuning.halving:
            self._halving = self._make_halving(tuning)
        self._weigh(tuning)

    def _build(self, tuning: Tuning) -> None:
        filters = filter_set(tuning.filters)
        grid = make_grid(tuning.horizon, self._period)
        self._grid = grid
        self._plant = make_plant(filters, grid, self._machine.head)
        self._rotation = RotationPart(filters, grid)
        self._reference = self._make_reference(tuning)
        self._halving = self._make_halving(tuning)
        pieces = len(grid.edges) - 1
        belongs = (grid.node_piece == np.arange(pieces)[:, None]) * grid.node_share
        self._to_pieces: Array = belongs / belongs.sum(axis=1, keepdims=True)
        instants = grid.knots[grid.nodes]
        self._looks = np.append(instants, instants[-1] + STOP_TIME)
        self._margins = margins_over(self._looks)
        self._weigh(tuning)

    def _make_reference(self, tuning: Tuning) -> Reference:
        instants = self._grid.knots[self._grid.nodes]
        return Reference(tuning.reference, self._period, instants, self._period)

    def _make_halving(self, tuning: Tuning):
        return make_halving(tuning.halving, self._machine, tuning.box, self._period)

    def _weigh(self, tuning: Tuning) -> None:
        self._tuning = tuning
        self._cost = make_cost(self._plant, tuning)
        self._rows = make_rows(self._plant, tuning)
        layout = self._rows.layout
        hessian = np.diag(self._rows.curvature)
        hessian[: layout.inputs, : layout.inputs] += self._cost.H
        self._hessian = frozen(hessian)
        slack = np.tile(np.arange(6) + layout.box.start, len(self._looks))
        table = np.zeros((len(slack), layout.size))
        table[:, : layout.inputs] = self._rows.box
        self._box_slack = slack
        self._box_table = table
        self._box_lower = np.concatenate(
            (np.full(layout.inputs, -LARGEST_INPUT), np.zeros(layout.size - layout.inputs))
        )
        self._box_upper = np.concatenate(
            (np.full(layout.inputs, LARGEST_INPUT), np.full(layout.size - layout.inputs, np.inf))
        )
        self._backend = make_backend(tuning.backend)
        self._fresh = True

    def propose(
        self, start: PlatformState, parent: Plan, takeover: float, stimulus: Stimulus
    ) -> Candidate | None:
        """Solve for the inputs and lay out the filters' answer; see `Cueing.propose`."""
        wanted = self._reference.predict(stimulus)
        if not np.isfinite(wanted).all():
            self._report = replace(self._report, solver_status="not finite", iterations=0)
            return None
        wanted[:, 5] = self._onset_of_yaw(wanted[:, 5], float(stimulus.rates[2]))
        rates = self._to_pieces @ wanted[:, 3:] * self._tuning.rotation_gain
        # yaw is a channel of its own here
        rates[:, 2] = 0.0
        rotation = self._rotation.ahead(parent, takeover, rates, STOP_TIME)
        state = stacked_state(minus(start, self._rotation.at(parent, takeover)))
        nodes = self._grid.nodes
        turned = np.append(nodes + 1, len(self._grid.knots) + 1)
        aim = self._aim(wanted, rotation[1][nodes + 1], rotation[3][nodes + 1])
        result = self._solve(state, aim, wanted, parent, takeover, rotation[1][turned])
        if result.status is not QpStatus.SOLVED and not (
            result.status is QpStatus.BUDGET and self._backend.name != "daqp"
        ):
            self._report = replace(
                self._report, solver_status=str(result.status), iterations=result.iterations
            )
            return None
        inputs = result.x[: self._rows.layout.inputs]
        return self._lay_out(start, state, inputs, rotation, result, aim)

    def _onset_of_yaw(self, rate: Array, now: float) -> Array:
        self._slow_yaw += (1.0 - np.exp(-YAW_CORNER * self._period)) * (now - self._slow_yaw)
        return rate - self._slow_yaw

    def _aim(self, wanted: Array, turn: Array, turn_acceleration: Array) -> Array:
        """Wanted outputs minus what the vehicle's own rotation and disturbances give, (4, N)."""
        known = np.zeros((4, len(wanted)))
        height = self._machine.head[2]
        pitch, roll = turn[:, Axis.PITCH], turn[:, Axis.ROLL]
        known[0] = -GRAVITY * pitch + height * turn_acceleration[:, Axis.PITCH]
        known[1] = GRAVITY * roll - height * turn_acceleration[:, Axis.ROLL]
        known[:3] += np.clip(self.disturbance, -LARGEST_DISTURBANCE, LARGEST_DISTURBANCE)[:, None]
        aim: Array = wanted[:, SIGNALS].T - known
        return aim

    def _solve(self, state, aim, wanted, parent, takeover, turned):
        layout, plant = self._rows.layout, self._plant
        tuning = self._tuning
        pieces = (self._to_pieces @ aim.T).T
        pieces[3] = 0.0
        q = self._rows.penalty.copy()
        q[: layout.inputs] = self._cost.linear(state, aim, pieces, self._last)
        free = plant.node_phi @ state + turned
        nominal = parent.poses(takeover + self._looks)
        share = self._halving.x_max / tuning.box
        box_free = (free / tuning.box).ravel()
        if tuning.legs:
            side = np.where(nominal >= 0.0, 1.0, -1.0).ravel()
            box = self._box_table * side[:, None]
            box[np.arange(len(side)), self._box_slack] = -1.0
            bounds = np.tile(share, len(free)) - side * box_free
            legs = leg_rows(self._machine, nominal, self._margins)
            leg = np.zeros((len(free) * 6, layout.size))
            leg[:, : layout.inputs] = np.matmul(legs.gradient, plant.node_gamma).reshape(
                -1, layout.inputs
            ) / LEG_UNIT
            leg[:, layout.leg] = -1.0
            room = legs.room - np.einsum("nla,na->nl", legs.gradient, free)
            upper = np.concatenate(
                (1.0 - self._rows.state @ state, bounds, room.ravel() / LEG_UNIT)
            )
            matrices = QpMatrices(self._hessian, np.concatenate((self._rows.A, box, leg)))
        else:
            bounds = np.tile(share, len(free))
            upper = np.concatenate(
                (1.0 - self._rows.state @ state, bounds - box_free, bounds + box_free)
            )
            matrices = None
            if self._fresh:
                both = []
                for sign in (1.0, -1.0):
                    box = self._box_table * sign
                    box[np.arange(len(box)), self._box_slack] = -1.0
                    both.append(box)
                matrices = QpMatrices(self._hessian, np.concatenate((self._rows.A, *both)))
        self._fresh = False
        vectors = QpVectors(
            q, np.full(len(upper), -np.inf), upper, self._box_lower, self._box_upper
        )
        return self._backend.solve(vectors, matrices)

    def _lay_out(self, start, state, inputs, rotation, result, aim):
        plant = self._plant
        tables = plant.phi @ state + plant.gamma @ inputs
        tables = np.concatenate((np.zeros((3, 1, 6)), tables), axis=1)
        times, pose, velocity, acceleration = with_stop(
            rotation[0][:-1], tables[0], tables[1], tables[2], STOP_TIME
        )
        pose, velocity = pose + rotation[1], velocity + rotation[2]
        acceleration = acceleration + rotation[3]
        pose[0], velocity[0], acceleration[0] = start.pose, start.velocity, start.acceleration
        if not np.isfinite(pose).all():
            return None
        layout = self._rows.layout
        slack = float(result.x[layout.leg]) * LEG_UNIT
        looks = np.append(self._grid.nodes + 1, len(pose) - 1)
        self._pending = pose[looks], inputs[:: plant.moves], start, slack
        force = plant.out_phi[:, 0] @ state + plant.out_gamma[:, 0] @ inputs
        self._report = Report(
            frozen(self._halving.x_max),
            result.iterations,
            str(result.status),
            {
                "leg_slack": slack,
                "rate_slack": float(np.max(result.x[layout.rate])) * self._tuning.tilt_rate,
                "wanted_x": float(aim[0, 0]),
                "wanted_y": float(aim[1, 0]),
                "predicted_x": float(force[0]),
                "predicted_y": float(force[1]),
            },
        )
        return Candidate(frozen(times), frozen(pose), frozen(velocity), frozen(acceleration))

    def adopt(self, plan: Plan, kappa: float) -> None:
        """Blend the rotation part alike, adapt the position limits; see `Cueing.adopt`."""
        self._rotation.adopt(plan, kappa)
        if self._pending is None:
            return
        poses, inputs, start, slack = self._pending
        self._pending = None
        self._last = self._last + kappa * (inputs - self._last)
        self._halving.settle(poses, start, self._tuning.box, kappa < 1.0 or slack > 1e-4)

    def report(self) -> Report:
        """Tell about the last step."""
        return self._report
