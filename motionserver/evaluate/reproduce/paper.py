"""The paper's one channel in closed loop: standard washout and model predictive control.

The plant is equation 5 with the filter set "fig3"; the controller is the server's own
`thondel2014`, fed with the surge signal alone and not certified, as in the paper.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import radians
from typing import Final

import numpy as np

from motionserver.core.axes import GRAVITY, Array, Axis, frozen
from motionserver.core.kinematics.hexapod import leg_lengths
from motionserver.core.kinematics.rotation import felt
from motionserver.core.limits import Machine
from motionserver.core.plan import Plan, rest_at
from motionserver.core.state import PlatformState, Stimulus
from motionserver.cueing.channels import SURGE
from motionserver.cueing.filters import discretise, filter_set
from motionserver.cueing.measured import MeasuredForce
from motionserver.cueing.thondel import Thondel
from motionserver.cueing.tuning import Tuning
from motionserver.evaluate.reproduce.signals import PERIOD, Signal

FILTERS: Final = "fig3"
BOX_TOLERANCE: Final = 1e-4
"""Share of a limit that counts as the solver's rounding."""
PLANT_GAIN: Final = 1.05
"""In the noise runs the platform does this much of what it is told [-]."""
NOISE: Final = 0.3
"""Standard deviation of the white noise on the measured acceleration [m/s2]."""
HARDNESS: Final = 20.0
"""All weights are divided by this. It changes nothing but their share in the exact penalties: the
box, soft in the live controller because legs are what counts, becomes hard as in the paper."""
PAPER: Final = Tuning(
    algorithm="thondel2014",
    scale=1.0,
    tilt_rate=radians(1000.0),
    filters=FILTERS,
    reference="constant",
    legs=False,
    halving="off",
    weight_force=1.0 / HARDNESS,
    weight_input=0.02 / HARDNESS,
    weight_change=0.02 / HARDNESS,
    weight_position=0.5 / HARDNESS,
)
"""Figure 3: the box of Table 2; the thresholds of Table 1 out of reach."""


@dataclass(frozen=True, slots=True)
class Run:
    """One channel over time.

    Attributes:
        name: Of the variant.
        signal: What was wanted.
        x: Surge, (N,) [m].
        tilt: phi = -pitch, (N,) [rad].
        tilt_rate: (N,) [rad/s].
        force: Felt specific force f_x, not linearised, (N,) [m/s2].
        legs_outside: Share of samples in which a leg would leave its stroke [-].
        x_max: Limit of surge in force, (N,) [m].
    """

    name: str
    signal: Signal
    x: Array
    tilt: Array
    tilt_rate: Array
    force: Array
    legs_outside: float
    x_max: Array

    @property
    def rmse(self) -> float:
        """RMSE of the felt force against the wanted acceleration [m/s2]."""
        return float(np.sqrt(np.mean((self.force - self.signal.wanted) ** 2)))

    @property
    def correlation(self) -> float:
        """Correlation of both [-]."""
        return float(np.corrcoef(self.force, self.signal.wanted)[0, 1])

    def outside(self, box: Array) -> Array:
        """Where the box (6,) of Table 2 is left, (N,)."""
        share = 1.0 + BOX_TOLERANCE
        out: Array = (np.abs(self.x) > share * box[Axis.SURGE]) | (
            np.abs(self.tilt) > share * box[Axis.PITCH]
        )
        return out


def run_of(
    name: str, signal: Signal, machine: Machine, states: Array, x_max: Array | None = None
) -> Run:
    """Judge surge and pitch of ``states``, (N, 3, 6): pose, velocity, acceleration."""
    pose, velocity, acceleration = states[:, 0], states[:, 1], states[:, 2]
    force, _ = felt(pose, velocity, acceleration, np.zeros(3))
    legs = leg_lengths(machine, pose)
    beyond = ((legs < machine.leg_min) | (legs > machine.leg_max)).any(axis=1)
    limit = np.full(len(pose), machine.box[Axis.SURGE]) if x_max is None else x_max
    return Run(
        name,
        signal,
        frozen(pose[:, Axis.SURGE]),
        frozen(-pose[:, Axis.PITCH]),
        frozen(-velocity[:, Axis.PITCH]),
        frozen(force[:, 0]),
        float(np.mean(beyond)),
        frozen(limit),
    )


def washout(name: str, signal: Signal, machine: Machine, scale: float = 1.0) -> Run:
    """The standard algorithm: the open loop of Figure 2, its input scaled once and for all."""
    a, b = discretise(SURGE.block(filter_set(FILTERS)), PERIOD)
    states = np.zeros((len(signal.times), 3, 6))
    state = np.zeros(6)
    for k, wanted in enumerate(signal.wanted):
        states[k] = _tables(state)
        state = a @ state + b * (scale * wanted)
    return run_of(name, signal, machine, states)


def worst_case_scale(signal: Signal, machine: Machine) -> float:
    """The scale at which the open loop just keeps the box of Table 2 on ``signal`` [-]."""
    run = washout("open loop", signal, machine)
    box = machine.box
    return min(
        1.0,
        float(box[Axis.SURGE] / np.max(np.abs(run.x))),
        float(box[Axis.PITCH] / np.max(np.abs(run.tilt))),
    )


def mpc(name: str, signal: Signal, machine: Machine, tuning: Tuning = PAPER) -> Run:
    """MPC-MCA on its own model: the first piece of every candidate is what is played."""
    cueing = Thondel(machine, tuning, PERIOD)
    parent, at = rest_at(np.zeros(6)), 0.0
    states = np.empty((len(signal.times), 3, 6))
    x_max = np.empty(len(signal.times))
    for k, wanted in enumerate(signal.wanted):
        start = parent.state(at)
        states[k] = start.pose, start.velocity, start.acceleration
        plan = _next(cueing, start, parent, at, float(wanted), k + 1)
        if plan is None:
            at += PERIOD
        else:
            parent, at = plan, PERIOD
        x_max[k] = cueing.report().x_max[Axis.SURGE]
    return run_of(name, signal, machine, states, x_max)


def mpc_measured(
    name: str, signal: Signal, machine: Machine, raw: bool, tuning: Tuning = PAPER
) -> tuple[Run, Array]:
    """MPC-MCA with a measured acceleration, on a platform that does `PLANT_GAIN` of its command.

    Args:
        name: Of the variant.
        signal: What is wanted.
        machine: Platform.
        raw: True puts measured pose and noisy acceleration in place of the model's state; False
            plans on the commanded state and lets the measurement in as a slow disturbance.
        tuning: Of the controller.

    Returns:
        The run of the platform if ``raw``, else of the set-points with the platform's own felt
        force; and the measured acceleration (N,) [m/s2].
    """
    cueing, estimate = Thondel(machine, tuning, PERIOD), MeasuredForce()
    noise = NOISE * np.random.default_rng(signal.wanted.size).standard_normal(len(signal.times))
    a, b = discretise(SURGE.block(filter_set(FILTERS)), PERIOD)
    count = len(signal.times)
    true, commanded = np.zeros(6), np.zeros(6)
    parent, at = rest_at(np.zeros(6)), 0.0
    told, done, measured = np.empty((count, 3, 6)), np.empty((count, 3, 6)), np.empty(count)
    for k, wanted in enumerate(signal.wanted):
        told[k], done[k] = _tables(commanded), _tables(true)
        measured[k] = true[2] + GRAVITY * true[3] + noise[k]
        if raw:
            believed = true.copy()
            believed[2] = measured[k] - GRAVITY * true[3]
        else:
            believed = commanded
            model = commanded[2] + GRAVITY * commanded[3]
            error = np.array([measured[k] - model, 0.0, 0.0])
            estimate.update(error, np.zeros(3), PERIOD)
            cueing.disturbance = estimate.disturbance
        start = PlatformState(*(frozen(row) for row in _tables(believed)))
        plan = _next(cueing, start, parent, at, float(wanted), k + 1)
        # the input is read off the plan: the one that takes x'' where the plan has it next
        parent, at = (parent, at + PERIOD) if plan is None else (plan, PERIOD)
        ahead = parent.state(at).acceleration[Axis.SURGE]
        push = (ahead - (a @ believed)[2]) / b[2]
        commanded = a @ commanded + b * push
        true = a @ true + PLANT_GAIN * b * push
    if raw:
        return run_of(name, signal, machine, done), frozen(measured)
    run = run_of(name, signal, machine, told)
    return replace(run, force=run_of(name, signal, machine, done).force), frozen(measured)


def _next(
    cueing: Thondel, start: PlatformState, parent: Plan, at: float, wanted: float, number: int
) -> Plan | None:
    stimulus = Stimulus(frozen([wanted, 0.0, 0.0]), frozen(np.zeros(3)))
    candidate = cueing.propose(start, parent, at, stimulus)
    if candidate is None:
        return None
    plan = Plan(
        number,
        parent.plan_id,
        at,
        candidate.times,
        candidate.pose,
        candidate.velocity,
        candidate.acceleration,
    )
    cueing.adopt(plan, 1.0)
    return plan


def _tables(state: Array) -> Array:
    """Pose, velocity, acceleration (3, 6) of the channel's state [x, x', x'', phi, phi', phi'']."""
    out = np.zeros((3, 6))
    out[:, Axis.SURGE] = state[:3]
    out[:, Axis.PITCH] = -state[3:]
    return out
