"""Cost of the six-axis programme: error of what is felt, and the price of being away and moving."""

from __future__ import annotations

from typing import Final

import numpy as np

from motionserver.core.axes import Array
from motionserver.core.state import PlatformState
from motionserver.cueing.mpc_grid import SplineGrid
from motionserver.cueing.mpc_nominal import Nominal
from motionserver.cueing.mpc_outputs import Outputs, linearise
from motionserver.cueing.mpc_rows import Layout
from motionserver.cueing.perception import FAMILIES, Perceived
from motionserver.cueing.tuning import Tuning
from motionserver.errors import TunableError

HEAVE_SHARE: Final = 3.0
"""Price of heave travel, in units of that of surge and sway; of yaw angle twice that of tilt."""
YAW_SHARE: Final = 6.0
VELOCITY: Final = (0.05, 0.02)
"""Price of moving, translations [per (m/s)2] and angles [per (rad/s)2]."""
ACCELERATION: Final = 0.002
JERK: Final = np.repeat((2e-6, 1e-4), 3)
"""Price of jerk per axis, per (m/s3)2 and (rad/s3)2. That of angles also keeps the plan from
trading yaw against roll from period to period: with 2e-6 a platform at its legs' ends was measured
to shake by 0.4 m/s2."""
JERK.setflags(write=False)
TILT_SLACK_SQUARE: Final = 1.0
"""Quadratic part of the price of tilting too fast, in units of the linear one."""
WEIGHED: Final = (
    "weight_force",
    "mpc_weight_heave",
    "mpc_weight_rates",
    "mpc_weight_position",
    "mpc_weight_attitude",
    "mpc_weight_tilt_rate",
    "mpc_trust",
    "perception",
)
"""Tunables that act here."""
LEG_SLACK: Final = (10.0, 0.001)
"""Linear and quadratic price of leaving the legs' margins, per `SLACK_UNIT`."""


class Cost:
    """Keeps what is constant of the cost and adds what the linearisation brings.

    Args:
        grid: The grid of plans.
        layout: Where the variables are.
        tuning: Weights.
        period: Planner period [s].

    Raises:
        ValueError: The tuning names a perception that does not exist.
    """

    def __init__(self, grid: SplineGrid, layout: Layout, tuning: Tuning, period: float) -> None:
        self._grid, self._layout = grid, layout
        self._period = period
        self._tuning = tuning
        self._perceived = make_perceived(tuning.perception, grid.nodes, period)
        self._outputs = np.zeros((len(grid.nodes), 6, 6, layout.columns))
        self._hessian = np.zeros((layout.size, layout.size))
        self._linear = np.zeros(layout.size)
        self.weigh(tuning)

    @property
    def factor(self) -> Array | None:
        """Weighted derivatives F of the outputs by the coefficients after `fill`: F'F is in H.

        (N nodes, outputs, 6 axes, K), each row of one instant alone; None where organs mix the
        errors of several.
        """
        return None if self._perceived is not None else self._outputs

    @property
    def tuning(self) -> Tuning:
        """The tuning whose weights are in force."""
        return self._tuning

    @property
    def prices(self) -> Array:
        """Of pose, velocity and acceleration at the nodes, per axis, (3, 6)."""
        return self._prices

    def weigh(self, tuning: Tuning) -> None:
        """Take other weights.

        Raises:
            ValueError: The tuning names a perception that does not exist; nothing has changed then.
        """
        if tuning.perception != self._tuning.perception:
            self._perceived = make_perceived(tuning.perception, self._grid.nodes, self._period)
        self._tuning = tuning
        grid, layout, maps = self._grid, self._layout, self._grid.at_nodes
        heave, rates = tuning.mpc_weight_heave, tuning.mpc_weight_rates
        force = tuning.weight_force
        self._weights = np.sqrt(
            grid.share[:, None] * np.array([force, force, force * heave, rates, rates, rates])
        )
        travel, turn = tuning.mpc_weight_position, tuning.mpc_weight_attitude
        places = (travel, travel, HEAVE_SHARE * travel, turn, turn, YAW_SHARE * turn)
        share = grid.share[:, None]
        self._prices = np.zeros((3, 6))
        constant = np.zeros((layout.size, layout.size))
        lengths = np.diff(grid.edges)[:, None]
        for axis, place in enumerate(places):
            speed = VELOCITY[0] if axis < 3 else VELOCITY[1]
            self._prices[:, axis] = place, speed, ACCELERATION
            block = JERK[axis] * (grid.basis.T @ (lengths * grid.basis))
            for price, gain in zip(
                self._prices[:, axis], (maps.pose, maps.velocity, maps.acceleration), strict=True
            ):
                block += price * (gain.T @ (share * gain))
            columns = slice(
                layout.slacks + axis * layout.columns, layout.slacks + (axis + 1) * layout.columns
            )
            constant[columns, columns] = block
        tilt = max(tuning.mpc_weight_tilt_rate, 1e-4)
        constant[0, 0] = LEG_SLACK[1]
        knots = np.arange(1, layout.slacks)
        constant[knots, knots] = tilt * TILT_SLACK_SQUARE
        self._constant = constant
        self._linear[0], self._linear[1 : layout.slacks] = LEG_SLACK[0], tilt
        self._pulls = [(gain * share).T for gain in (maps.pose, maps.velocity, maps.acceleration)]
        self._jerk_pull = (lengths * grid.basis).T

    def remember(self, start: PlatformState, wanted: Array, arm: Array) -> None:
        """Let the organs take in what is felt at the hand-over against what is ``wanted`` (6,)."""
        if self._perceived is not None:
            parts = start.pose[None], start.velocity[None], start.acceleration[None]
            self._perceived.learn(linearise(*parts, arm).value[0] - wanted)

    def fill(
        self, nominal: Nominal, outputs: Outputs, wanted: Array, known: float
    ) -> tuple[Array, Array]:
        """Hessian (n, n) and gradient (n,) about a nominal.

        Args:
            nominal: The motion at the nodes.
            outputs: What is felt there.
            wanted: What should be felt there, (N, 6).
            known: Until when it is known rather than believed [s].
        """
        maps, layout = self._grid.at_nodes, self._layout
        beyond = np.maximum(self._grid.nodes - known, 0.0)
        weights = self._weights * np.exp(-0.5 * beyond / self._tuning.mpc_trust)[:, None]
        error = outputs.value - wanted
        # where organs filter the error, weights come after them
        early = weights if self._perceived is None else np.ones_like(weights)
        out, count = self._outputs, len(weights)
        force, rates = early[:, :3, None], early[:, 3:, None]
        np.multiply(
            (force * outputs.by_acceleration)[..., None],
            maps.acceleration[:, None, None],
            out=out[:, :3],
        )
        out[:, :3, 3:] += (force * outputs.by_pose[:, :3])[..., None] * maps.pose[:, None, None]
        np.multiply(
            (rates * outputs.by_velocity)[..., None],
            maps.velocity[:, None, None],
            out=out[:, 3:, 3:],
        )
        flat = out.reshape(6 * count, 6 * layout.columns)
        if self._perceived is not None:
            flat, error = self._sensed(flat, error, weights)
        else:
            error = weights * error
        slacks = layout.slacks
        np.copyto(self._hessian, self._constant)
        self._hessian[slacks:, slacks:] += flat.T @ flat
        pull = self._jerk_pull @ (JERK * nominal.jerks)
        motion = (nominal.pose, nominal.velocity, nominal.acceleration)
        for price, gain, part in zip(self._prices, self._pulls, motion, strict=True):
            pull += gain @ (price * part)
        self._linear[slacks:] = error.ravel() @ flat + pull.T.ravel()
        return self._hessian, self._linear

    def _sensed(self, flat: Array, error: Array, weights: Array) -> tuple[Array, Array]:
        """Both as the organs feel them, then weighted."""
        perceived = self._perceived
        assert perceived is not None
        felt = np.einsum("onm,mo->no", perceived.maps, error) + perceived.remembered()
        by_output = flat.reshape(len(error), 6, -1).transpose(1, 0, 2)
        moved = np.matmul(perceived.maps, by_output).transpose(1, 0, 2)
        return (weights[..., None] * moved).reshape(flat.shape), weights * felt


def make_perceived(name: str, nodes: Array, period: float) -> Perceived | None:
    """The organs of a perception by name; None for "none".

    Raises:
        ValueError: There is no such perception.
    """
    if name == "none":
        return None
    if name not in FAMILIES:
        raise TunableError(
            "perception", f"perception {name!r} does not exist", f"none, {', '.join(FAMILIES)}"
        )
    return Perceived(FAMILIES[name], nodes, period)
