"""Motion cueing by model predictive control after Thoendel (ECMS 2014), on four channels.

Every channel keeps the paper's form: one input U drives a high-pass to the platform's position and
a low-pass to its tilt (equation 5); the controller scales and shapes U. Limits are the platform's
box (Table 2), the threshold of tilt rate (Table 1, soft) and, beyond the paper, the legs' stroke.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Final

import numpy as np

from motionserver.core.axes import GRAVITY, Array, Axis, frozen
from motionserver.core.limits import Machine
from motionserver.core.plan import Plan
from motionserver.core.state import PlatformState, Stimulus
from motionserver.cueing.base import Candidate, Report
from motionserver.cueing.channels import CHANNELS, minus
from motionserver.cueing.filters import filter_set
from motionserver.cueing.halving import Halving, make_halving
from motionserver.cueing.horizon import make_grid
from motionserver.cueing.measured import believed
from motionserver.cueing.reference import Reference, believable
from motionserver.cueing.rotation import RotationPart
from motionserver.cueing.stopping import STOP_TIME, with_stop
from motionserver.cueing.thondel_plant import make_plant, stacked_state
from motionserver.cueing.thondel_qp import Programme
from motionserver.cueing.thondel_rows import LEG_UNIT
from motionserver.cueing.tuning import Tuning
from motionserver.solvers.base import QpResult
from motionserver.solvers.registry import make_backend

YAW_CORNER: Final = 0.5
"""High-pass of the wanted yaw rate [rad/s]."""
SLACK_NOTICED: Final = 1e-4
"""Leg slack that counts as trouble [m]."""


@dataclass(frozen=True, slots=True)
class _Pending:
    """What `adopt` needs of the last candidate."""

    poses: Array
    inputs: Array
    start: PlatformState
    leg_slack: float


class Thondel:
    """The algorithm ``thondel2014``.

    Args:
        machine: Geometry and limits.
        tuning: Tunables.
        period: Planner period; the hand-over is one period ahead [s].

    Attributes:
        disturbance: Specific force nobody planned, as estimated outside, (3,) [m/s2].

    Raises:
        ValueError: The tuning names a filter set, model, backend or halving that does not exist.
    """

    name = "thondel2014"
    tunables: ClassVar[frozenset[str]] = frozenset(
        {
            "rotation_gain",
            "tilt_rate",
            "tilt_acceleration",
            "tilt_acceleration_weight",
            "box",
            "halving",
            "legs",
            "horizon",
            "weight_force",
            "weight_input",
            "weight_change",
            "weight_position",
            "filters",
            "reference",
            "predictor",
            "backend",
        }
    )

    _halving: Halving

    def __init__(self, machine: Machine, tuning: Tuning, period: float) -> None:
        self._machine, self._period = machine, period
        self.disturbance: Array = np.zeros(3)
        self._last = np.zeros(len(CHANNELS))
        self._slow_yaw = 0.0
        self._yaw_share = 1.0 - float(np.exp(-YAW_CORNER * period))
        self._pending: _Pending | None = None
        self._tuning = tuning
        filters = filter_set(tuning.filters)
        self._grid = make_grid(tuning.horizon, period)
        self._rotation = RotationPart(filters, self._grid)
        self._halving = make_halving(tuning.halving, machine, tuning.box, period)
        self._build(tuning)
        self._report = Report(frozen(self._halving.x_max))

    def retune(self, tuning: Tuning) -> None:
        """Take other tunables; cheap unless filters, horizon, reference or backend change.

        Motion stays continuous whatever changes: the next plan begins on the accepted one.

        Raises:
            ValueError: As in the constructor; nothing has changed then.
        """
        old = self._tuning
        self._check(tuning)
        if (old.filters, old.horizon) != (tuning.filters, tuning.horizon):
            self._grid = make_grid(tuning.horizon, self._period)
            self._rotation.rebuild(filter_set(tuning.filters), self._grid)
            self._build(tuning)
        else:
            self._programme.weigh(tuning)
            if (old.reference, old.predictor) != (tuning.reference, tuning.predictor):
                self._reference = self._make_reference(tuning)
        if old.halving != tuning.halving:
            x_max = np.minimum(self._halving.x_max, tuning.box)
            self._halving = make_halving(tuning.halving, self._machine, tuning.box, self._period)
            self._halving.x_max = x_max if tuning.halving != "off" else self._halving.x_max
        self._tuning = tuning

    @property
    def tuning(self) -> Tuning:
        """Tunables in force, read from the parts that use them."""
        return replace(
            self._programme.tuning,
            rotation_gain=self._tuning.rotation_gain,
            horizon=self._horizon,
            filters=self._filters,
            halving=self._halving.kind,
            reference=self._reference.model,
            predictor=self._reference.predictor,
            backend=self._programme.backend,
        )

    def _check(self, tuning: Tuning) -> None:
        """Stumble over words that do not exist before anything is changed."""
        filter_set(tuning.filters)
        make_halving(tuning.halving, self._machine, tuning.box, self._period)
        Reference(tuning.reference, self._period, np.zeros(1), 0.0, tuning.predictor)
        if tuning.backend != self._tuning.backend:
            make_backend(tuning.backend)

    def _build(self, tuning: Tuning) -> None:
        """Everything that depends on the grid or the filters."""
        grid, filters = self._grid, filter_set(tuning.filters)
        self._filters, self._horizon = filters.name, tuning.horizon
        self._plant = make_plant(filters, grid, self._machine.head)
        self._programme = Programme(self._machine, self._plant, tuning)
        self._reference = self._make_reference(tuning)
        belongs = (grid.node_piece == np.arange(self._plant.moves)[:, None]) * grid.node_share
        self._to_pieces: Array = belongs / belongs.sum(axis=1, keepdims=True)

    def _make_reference(self, tuning: Tuning) -> Reference:
        instants = self._grid.knots[self._grid.nodes]
        return Reference(tuning.reference, self._period, instants, self._period, tuning.predictor)

    def propose(
        self, start: PlatformState, parent: Plan, takeover: float, stimulus: Stimulus
    ) -> Candidate | None:
        """Solve for the inputs and lay out the filters' answer; see `Cueing.propose`."""
        self._pending = None
        believed = believable(stimulus)
        if believed is None:
            self._say("not finite", 0)
            return None
        wanted = self._reference.predict(believed)
        wanted[:, 5] = self._onset_of_yaw(wanted[:, 5], float(believed.rates[2]))
        rates = self._to_pieces @ wanted[:, 3:] * self._tuning.rotation_gain
        # yaw is a channel of its own here
        rates[:, 2] = 0.0
        rotation = self._rotation.ahead(parent, takeover, rates, STOP_TIME)
        state = stacked_state(minus(start, self._rotation.at(parent, takeover)))
        nodes = self._grid.nodes + 1
        looks = np.append(nodes, len(rotation[0]) - 1)
        aim = self._aim(wanted, rotation[1][nodes], rotation[3][nodes])
        input_aim = aim @ self._to_pieces.T
        # a yaw rate is wanted, no yaw acceleration
        input_aim[3] = 0.0
        result = self._programme.solve(
            state,
            aim,
            input_aim,
            self._last,
            rotation[1][looks],
            parent.poses(takeover + self._programme.looks),
            self._halving.x_max,
        )
        if not result.usable:
            self._say(str(result.status), result.iterations)
            return None
        inputs = result.x[: self._programme.layout.inputs]
        tables = np.concatenate(
            (np.zeros((3, 1, 6)), self._plant.phi @ state + self._plant.gamma @ inputs), axis=1
        )
        times, *laid = with_stop(rotation[0][:-1], tables[0], tables[1], tables[2], STOP_TIME)
        pose, velocity, acceleration = (
            part + turn for part, turn in zip(laid, rotation[1:], strict=True)
        )
        pose[0], velocity[0], acceleration[0] = start.pose, start.velocity, start.acceleration
        self._tell(state, inputs, result, aim)
        slack = float(result.x[self._programme.layout.leg]) * LEG_UNIT
        self._pending = _Pending(pose[looks], inputs[:: self._plant.moves], start, slack)
        return Candidate(frozen(times), frozen(pose), frozen(velocity), frozen(acceleration))

    def _say(self, status: str, iterations: int) -> None:
        self._report = replace(self._report, solver_status=status, iterations=iterations)

    def _onset_of_yaw(self, rate: Array, now: float) -> Array:
        self._slow_yaw += self._yaw_share * (now - self._slow_yaw)
        return rate - self._slow_yaw

    def _aim(self, wanted: Array, turn: Array, turn_acceleration: Array) -> Array:
        """Wanted outputs minus what the vehicle's own rotation and disturbances give, (4, N)."""
        aim: Array = wanted[:, [channel.signal for channel in CHANNELS]].T
        height = self._machine.head[2]
        aim[0] -= -GRAVITY * turn[:, Axis.PITCH] + height * turn_acceleration[:, Axis.PITCH]
        aim[1] -= GRAVITY * turn[:, Axis.ROLL] - height * turn_acceleration[:, Axis.ROLL]
        aim[:3] -= believed(self.disturbance)[:, None]
        return aim

    def _tell(self, state: Array, inputs: Array, result: QpResult, aim: Array) -> None:
        layout, plant = self._programme.layout, self._plant
        force = plant.out_phi[:, 0] @ state + plant.out_gamma[:, 0] @ inputs
        self._report = Report(
            frozen(self._halving.x_max),
            result.iterations,
            str(result.status),
            {
                "leg_slack": float(result.x[layout.leg]) * LEG_UNIT,
                "tilt_rate_slack": float(np.max(result.x[layout.rate])) * self._tuning.tilt_rate,
                "wanted_x": float(aim[0, 0]),
                "wanted_y": float(aim[1, 0]),
                "wanted_z": float(aim[2, 0]),
                "predicted_x": float(force[0]),
                "predicted_y": float(force[1]),
                "predicted_z": float(force[2]),
            },
            self._reference.describe(),
        )

    def adopt(self, plan: Plan, kappa: float) -> None:
        """Blend the rotation part alike, adapt the position limits; see `Cueing.adopt`."""
        self._rotation.adopt(plan, kappa)
        last = self._pending
        if last is None:
            return
        self._pending = None
        self._last = self._last + kappa * (last.inputs - self._last)
        trouble = kappa < 1.0 or last.leg_slack > SLACK_NOTICED
        self._halving.settle(last.poses, last.start, self._tuning.box, trouble)

    def report(self) -> Report:
        """Tell about the last step."""
        return self._report
