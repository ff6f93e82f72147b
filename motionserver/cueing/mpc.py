"""Motion cueing by model predictive control on all six axes of the hexapod at once.

Where Thoendel (ECMS 2014) scales one input per channel inside a box, here six jerks are free, and
the legs themselves are the limits: lengths, speeds, accelerations and jerks, linearised each period
about the rest of the accepted plan. What is followed is the specific force at the head and the body
rates. Every plan ends at rest by construction (`mpc_grid`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import exp
from typing import ClassVar, Final

import numpy as np

from motionserver.core.axes import Array, frozen
from motionserver.core.limits import Machine
from motionserver.core.plan import Plan
from motionserver.core.state import PlatformState, Stimulus
from motionserver.cueing.base import Candidate, Report
from motionserver.cueing.measured import believed
from motionserver.cueing.mpc_cost import WEIGHED, Cost
from motionserver.cueing.mpc_grid import PIECES, make_spline_grid
from motionserver.cueing.mpc_nominal import Nominal, Projection
from motionserver.cueing.mpc_outputs import linearise
from motionserver.cueing.mpc_rows import SLACK_UNIT, Rows
from motionserver.cueing.mpc_stages import make_solver
from motionserver.cueing.mpc_workspace import tuned_axes
from motionserver.cueing.reference import Reference, believable
from motionserver.cueing.tuning import Tuning
from motionserver.solvers.base import INFINITE, QpMatrices, QpVectors

RATE_CORNER: Final = 0.5
"""High-pass of the wanted body rates [rad/s]: turning on and on cannot be followed."""


class SixAxis:
    """The algorithm ``mpc``.

    Args:
        machine: Geometry and limits.
        tuning: Tunables.
        period: Planner period; the hand-over is one period ahead [s].
        pieces: Pieces of constant jerk over the horizon.
        iterations: Fixed budget of the solver; None is the backend's own.

    Attributes:
        disturbance: Specific force nobody planned, as estimated outside, (3,) [m/s2].
        clock: Seconds, put in from outside to learn what the parts of a step take; the report then
            has t_linearise, t_fill and t_solve.

    Raises:
        ValueError: The tuning names a model or backend that does not exist, or the pieces do not
            fit into its horizon.
    """

    name = "mpc"
    tunables: ClassVar[frozenset[str]] = frozenset(
        {
            "rotation_gain",
            "tilt_rate",
            "box",
            "horizon",
            "weight_force",
            "reference",
            "predictor",
            "backend",
            "mpc_weight_heave",
            "mpc_weight_rates",
            "mpc_weight_position",
            "mpc_weight_attitude",
            "mpc_weight_tilt_rate",
            "mpc_trust",
            "perception",
        }
    )

    def __init__(
        self,
        machine: Machine,
        tuning: Tuning,
        period: float,
        pieces: int = PIECES,
        iterations: int | None = None,
    ) -> None:
        self._iterations = iterations
        self._machine, self._period, self._pieces = machine, period, pieces
        self.disturbance: Array = np.zeros(3)
        self.clock: Callable[[], float] | None = None
        self._slow = np.zeros(3)
        self._slow_share = 1.0 - exp(-RATE_CORNER * period)
        self._tuning = tuning
        self._build(tuning)
        self._report = Report(frozen(tuning.box), bounded=self._rows.axes)

    def _build(self, tuning: Tuning) -> None:
        grid = make_spline_grid(tuning.horizon, self._period, self._pieces)
        reference = self._make_reference(tuning, grid.nodes)
        rows = Rows(self._machine, grid, self._period, tuning.box)
        cost = Cost(grid, rows.layout, tuning, self._period)
        backend = make_solver(tuning.backend, grid, cost, self._iterations)
        # nothing is replaced before everything is made
        self._reference, self._grid, self._projection = reference, grid, Projection(grid)
        self._rows, self._cost, self._backend = rows, cost, backend
        slacks = self._rows.layout.slacks
        self._box = np.zeros(slacks), np.full(slacks, INFINITE)

    def _make_reference(self, tuning: Tuning, nodes: Array) -> Reference:
        return Reference(tuning.reference, self._period, nodes, self._period, tuning.predictor)

    def retune(self, tuning: Tuning) -> None:
        """Take other tunables; cheap unless horizon, reference, backend or tuned axes change.

        Raises:
            ValueError: As in the constructor; nothing has changed then.
        """
        old = self._tuning
        axes = [tuned_axes(self._machine, each.box) for each in (old, tuning)]
        if old.horizon != tuning.horizon or axes[0] != axes[1]:
            self._build(tuning)
        else:
            reference, backend = self._reference, self._backend
            if (old.reference, old.predictor) != (tuning.reference, tuning.predictor):
                reference = self._make_reference(tuning, self._grid.nodes)
            if old.backend != tuning.backend:
                backend = make_solver(tuning.backend, self._grid, self._cost, self._iterations)
            self._cost.weigh(tuning)
            self._reference, self._backend = reference, backend
        self._tuning = tuning

    @property
    def tuning(self) -> Tuning:
        """Tunables in force, read from the parts that use them."""
        weights = self._cost.tuning
        return replace(
            self._tuning,
            horizon=self._grid.horizon,
            reference=self._reference.model,
            predictor=self._reference.predictor,
            backend=self._backend.name,
            **{name: getattr(weights, name) for name in WEIGHED},
        )

    def propose(
        self, start: PlatformState, parent: Plan, takeover: float, stimulus: Stimulus
    ) -> Candidate | None:
        """Linearise about the rest of the accepted plan and solve; see `Cueing.propose`."""
        believed = believable(stimulus)
        if believed is None:
            self._say("not finite", 0)
            return None
        wanted = self._wanted(believed)
        instants = [self._now()]
        nominal = self._projection.of(start, parent, takeover)
        outputs = linearise(
            nominal.pose, nominal.velocity, nominal.acceleration, self._machine.head
        )
        self._cost.remember(start, wanted[0], self._machine.head)
        instants.append(self._now())
        hessian, linear = self._cost.fill(nominal, outputs, wanted, self._reference.known)
        lower, upper = self._rows.fill(
            start, nominal, outputs, wanted[:, 3:], self._tuning.tilt_rate, self._tuning.box
        )
        instants.append(self._now())
        result = self._backend.solve(
            QpVectors(linear, lower, upper, *self._box), QpMatrices(hessian, self._rows.matrix)
        )
        instants.append(self._now())
        if not result.usable:
            self._say(str(result.status), result.iterations)
            return None
        slacks = self._rows.layout.slacks
        self._report = Report(
            frozen(self._tuning.box),
            result.iterations,
            str(result.status),
            {
                "leg_slack": float(result.x[0]) * SLACK_UNIT,
                "tilt_rate_slack": float(result.x[1:slacks].max()) * self._tuning.tilt_rate,
                "wanted_x": float(wanted[0, 0]),
                "wanted_y": float(wanted[0, 1]),
                "wanted_z": float(wanted[0, 2]),
                **self._times(instants),
            },
            self._reference.describe(),
            self._rows.axes,
            self._rows.shares(result.x),
        )
        return self._candidate(start, nominal, result.x[slacks:].reshape(6, -1).T)

    def _now(self) -> float:
        return 0.0 if self.clock is None else self.clock()

    def _times(self, instants: list[float]) -> dict[str, float]:
        if self.clock is None:
            return {}
        names = ("t_linearise", "t_fill", "t_solve")
        return dict(zip(names, np.diff(instants).tolist(), strict=True))

    def _wanted(self, stimulus: Stimulus) -> Array:
        """Outputs to follow at the nodes, (N, 6): forces, and rates without their slow part."""
        self._slow = self._slow + self._slow_share * (stimulus.rates - self._slow)
        preview = stimulus.preview
        if preview is not None and len(preview.times):
            quick = preview.rates - self._slow_ahead(preview.times, preview.rates)
            preview = replace(preview, rates=quick)
        quick = stimulus.rates - self._slow
        shown = replace(stimulus, rates=quick, preview=preview)
        wanted = self._reference.predict(shown, stimulus.rates)
        wanted[:, 3:] *= self._tuning.rotation_gain
        wanted[:, :3] -= believed(self.disturbance)
        return wanted

    def _slow_ahead(self, times: Array, rates: Array) -> Array:
        """The slow part of previewed rates, (n, 3) [rad/s]."""
        shares = 1.0 - np.exp(-RATE_CORNER * np.maximum(np.diff(times, prepend=0.0), 0.0))
        slow, out = self._slow, np.empty_like(rates)
        for index, share in enumerate(shares):
            slow = slow + share * (rates[index] - slow)
            out[index] = slow
        return out

    def _candidate(self, start: PlatformState, nominal: Nominal, deltas: Array) -> Candidate:
        grid, maps = self._grid, self._grid.at_nodes
        knots = grid.knots
        tables = []
        for begin, part, gain in (
            (start.pose, nominal.pose, maps.pose),
            (start.velocity, nominal.velocity, maps.velocity),
            (start.acceleration, nominal.acceleration, maps.acceleration),
        ):
            tables.append(np.concatenate((begin[None], part[knots] + gain[knots] @ deltas)))
        pose, velocity, acceleration = tables
        # rest to the last bit: rounding leaves 1e-16 otherwise
        velocity[-1] = acceleration[-1] = 0.0
        return Candidate(grid.edges, frozen(pose), frozen(velocity), frozen(acceleration))

    def _say(self, status: str, iterations: int) -> None:
        self._report = replace(self._report, solver_status=status, iterations=iterations)

    def adopt(self, plan: Plan, kappa: float) -> None:
        """Nothing to remember: the next period reads everything from the accepted plan."""

    def report(self) -> Report:
        """Tell about the last step."""
        return self._report
