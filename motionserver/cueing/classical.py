"""The classical washout with tilt coordination (Reid and Nahon 1985), as plans.

Specific force, high-passed, moves the platform; low-passed, tilts it, with the limit of tilt rate
inside the loop; the vehicle's own rates turn it, high-passed. A plan is the filters' answer to the
present input held briefly and faded, then a smooth stop.
"""

from __future__ import annotations

from typing import ClassVar, Final

import numpy as np

from motionserver.core.axes import GRAVITY, Array, Axis, frozen
from motionserver.core.limits import Machine
from motionserver.core.plan import Plan
from motionserver.core.state import PlatformState, Stimulus
from motionserver.cueing.base import Candidate, Report
from motionserver.cueing.channels import minus
from motionserver.cueing.filters import Block, Corner, FilterSet, discretise, high_pass
from motionserver.cueing.horizon import make_grid
from motionserver.cueing.reference import believable
from motionserver.cueing.rotation import RotationPart
from motionserver.cueing.stopping import STOP_TIME, with_stop
from motionserver.cueing.tuning import Tuning

REID_NAHON: Final = FilterSet(
    "reid-nahon",
    high=Corner(2.5, 1.0, 0.04),
    low=Corner(5.0, 1.0, 0.05),
    heave=Corner(4.0, 1.0, 0.04),
    yaw=Corner(1.0, 1.0, 0.05),
    rotation=0.7,
    rotation_tau=0.03,
)
"""Corners of a standard washout (set CW1)."""
LOOK: Final = 0.3
"""How far the filters' answer is laid out [s]."""
HOLD: Final = 0.1
"""How long the present input is held in it [s]."""
FADE: Final = 0.1
"""Time constant of its fade after that [s]."""
_TRANSLATION: Final = slice(0, 3)
_TILT: Final = ((Axis.PITCH, -1.0), (Axis.ROLL, 1.0))


class Classical:
    """The algorithm ``classical``.

    Args:
        machine: Geometry and limits.
        tuning: Tunables.
        period: Planner period [s].
        filters: Corners of the washout.
    """

    name = "classical"
    tunables: ClassVar[frozenset[str]] = frozenset({"gain", "rotation_gain", "tilt_rate"})

    def __init__(
        self, machine: Machine, tuning: Tuning, period: float, filters: FilterSet = REID_NAHON
    ) -> None:
        self._machine, self._tuning, self._period = machine, tuning, period
        # part of the interface; a filter does not predict, so nothing is corrected by it
        self.disturbance: Array = np.zeros(3)
        grid = make_grid(LOOK, period)
        self._times = grid.knots
        self._rotation = RotationPart(filters, grid)
        begins = np.concatenate(([0.0], grid.knots[:-1]))
        self._input_share = np.exp(-np.maximum(0.0, begins - HOLD) / FADE)
        self._piece_share = np.exp(-np.maximum(0.0, grid.edges[:-1] - HOLD) / FADE)
        steps = np.diff(np.concatenate(([0.0], grid.knots)))
        horizontal, vertical = high_pass(filters.high), high_pass(filters.heave)
        self._translations = [
            (discretise(horizontal, step), discretise(vertical, step)) for step in steps
        ]
        self._tilt = TiltLoop(filters.low, steps)
        self._slow_share = 1.0 - np.exp(-filters.yaw.omega * period)
        self._slow_yaw = 0.0
        self._report = Report(frozen(machine.box), bounded=())

    def retune(self, tuning: Tuning) -> None:
        """Take other tunables: gains and the limit of tilt rate."""
        self._tuning = tuning

    @property
    def tuning(self) -> Tuning:
        """Tunables in force."""
        return self._tuning

    def propose(
        self, start: PlatformState, parent: Plan, takeover: float, stimulus: Stimulus
    ) -> Candidate | None:
        """Lay out the filters' answer; see `Cueing.propose`."""
        believed = believable(stimulus)
        if believed is None:
            self._report = Report(frozen(self._machine.box), 0, "not finite", bounded=())
            return None
        tuning = self._tuning
        force = tuning.gain * believed.force
        rotation = self._rotation.ahead(
            parent, takeover, self._piece_share[:, None] * self._rates(believed.rates), STOP_TIME
        )
        tilt_only = minus(start, self._rotation.at(parent, takeover))
        now = np.stack((tilt_only.pose, tilt_only.velocity, tilt_only.acceleration))
        tables = np.zeros((3, len(self._times) + 1, 6))
        tables[:, 0] = now
        tables[:, 1:, _TRANSLATION] = self._translate(now[:, _TRANSLATION], force)
        axes = [axis for axis, _ in _TILT]
        signs = np.array([sign for _, sign in _TILT])
        wanted = self._input_share[:, None] * force[:2] / GRAVITY
        tables[:, 1:, axes] = signs * self._tilt.run(signs * now[:, axes], wanted, tuning.tilt_rate)
        times, pose, velocity, acceleration = with_stop(
            np.concatenate(([0.0], self._times)), tables[0], tables[1], tables[2], STOP_TIME
        )
        pose, velocity = pose + rotation[1], velocity + rotation[2]
        acceleration = acceleration + rotation[3]
        pose[0], velocity[0], acceleration[0] = start.pose, start.velocity, start.acceleration
        self._report = Report(
            frozen(self._machine.box),
            numbers={"wanted_x": float(force[0]), "wanted_y": float(force[1])},
            bounded=(),
        )
        return Candidate(frozen(times), frozen(pose), frozen(velocity), frozen(acceleration))

    def _rates(self, rates: Array) -> Array:
        """Inputs of the rotation part; yaw is high-passed twice, a long curve must wash out."""
        self._slow_yaw += self._slow_share * (float(rates[2]) - self._slow_yaw)
        gain = self._tuning.rotation_gain
        yaw_gain = self._tuning.gain
        return np.array([gain * rates[0], gain * rates[1], yaw_gain * (rates[2] - self._slow_yaw)])

    def _translate(self, now: Array, force: Array) -> Array:
        """High-passes of surge, sway, heave from state (3, 3 axes): (3, K, 3 axes)."""
        out = np.empty((3, len(self._times), 3))
        state = now
        for index, ((flat, push), (rise, lift)) in enumerate(self._translations):
            share = self._input_share[index] * force
            state = np.column_stack(
                (
                    flat @ state[:, :2] + push[:, None] * share[:2],
                    rise @ state[:, 2] + lift * share[2],
                )
            )
            out[:, index] = state
        return out

    def adopt(self, plan: Plan, kappa: float) -> None:
        """Blend the rotation part alike; see `Cueing.adopt`."""
        self._rotation.adopt(plan, kappa)

    def report(self) -> Report:
        """Tell about the last step."""
        return self._report


class TiltLoop:
    """Third-order low-pass whose rate is limited inside its own loop.

    The companion form s3 + a2 s2 + a1 s + a0 is the cascade: wanted rate v = (a0/a1)(u - phi),
    then phi''' = a1 (v - phi') - a2 phi''. Clipping v to the threshold limits the rate without
    wind-up and changes nothing while it does not bind.

    Args:
        corner: The low-pass.
        steps: Time steps it will be run over, (K,) [s].
    """

    def __init__(self, corner: Corner, steps: Array) -> None:
        lag, square = 1.0 / corner.tau, corner.omega**2
        damping = 2.0 * corner.zeta * corner.omega
        a0, a1, a2 = square * lag, square + damping * lag, damping + lag
        self._gain = a0 / a1
        free = Block(
            frozen([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-a0, -a1, -a2]]), frozen([0.0, 0.0, a0])
        )
        bound = Block(
            frozen([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, -a1, -a2]]), frozen([0.0, 0.0, a1])
        )
        self._steps = [(discretise(free, step), discretise(bound, step)) for step in steps]

    def run(self, state: Array, wanted: Array, rate: float) -> Array:
        """Follow wanted tilts.

        Args:
            state: Tilt and its derivatives now, (3, C).
            wanted: On each step, (K, C) [rad].
            rate: Threshold [rad/s].

        Returns:
            States after each step, (3, K, C).
        """
        out = np.empty((3, len(wanted), state.shape[1]))
        for index, ((free, push), (bound, drive)) in enumerate(self._steps):
            speed = self._gain * (wanted[index] - state[0])
            linear = free @ state + push[:, None] * wanted[index]
            limited = bound @ state + drive[:, None] * np.clip(speed, -rate, rate)
            state = np.where(np.abs(speed) <= rate, linear, limited)
            out[:, index] = state
        return out
