"""One drive as arrays: wanted, executed, felt, and what planner and guard did meanwhile."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from motionserver.core.axes import GRAVITY, Array, frozen
from motionserver.core.kinematics.hexapod import leg_lengths
from motionserver.core.kinematics.rotation import felt, transfer
from motionserver.core.limits import Machine
from motionserver.core.state import DriveMode
from motionserver.evaluate.recording import Recording

RATE_HZ: Final = 500.0
"""Rate of the executed samples unless told otherwise [Hz]."""
_STILL: Final = (DriveMode.PAUSE, DriveMode.BYE)


@dataclass(frozen=True, slots=True)
class Periods:
    """What the planner and the guard's verification did, one row per planner period.

    Attributes:
        times: Beginning of the period, (P,) [s].
        kappa: Share of the candidate that was let through, NaN without a candidate, (P,) [-].
        iterations: Of the solver, (P,).
        x_max: Position limits in force, (P, 6) [m, rad].
        force: Wanted specific force after intake, gravity removed, (P, 3) [m/s2].
        rates: Wanted body rates after intake, (P, 3) [rad/s].
        seconds: Time one `think` took on this computer, (P,) [s]; the only field that differs from
            run to run.
        refusals: Candidates the governor halved or dropped, by reason of the first refusal.
        rejections: Proposals the guard's own verification rejected, by reason.
        troubles: Periods without a candidate, by what the algorithm said.
        gate: Samples the gate did not believe, by counter.
    """

    times: Array
    kappa: Array
    iterations: Array
    x_max: Array
    force: Array
    rates: Array
    seconds: Array
    refusals: dict[str, int]
    rejections: dict[str, int]
    troubles: dict[str, int]
    gate: dict[str, int]


@dataclass(frozen=True, slots=True)
class Drive:
    """One recording driven by one algorithm: wanted, executed, felt.

    Attributes:
        name: Algorithm, or what else moved the platform.
        machine: The platform.
        rate: Of the samples [Hz].
        times: (N,) [s].
        pose: (N, 6) [m, rad].
        velocity: (N, 6).
        acceleration: (N, 6).
        legs: Pin to pin, (N, 6) [m].
        wanted_force: Scaled specific force at the vehicle's head minus g e_z, (N, 3) [m/s2].
        wanted_rates: Scaled body rates, (N, 3) [rad/s].
        periods: What planner and guard did; None if nobody planned.
    """

    name: str
    machine: Machine
    rate: float
    times: Array
    pose: Array
    velocity: Array
    acceleration: Array
    legs: Array
    wanted_force: Array
    wanted_rates: Array
    periods: Periods | None

    def felt(self) -> tuple[Array, Array]:
        """Specific force at the head minus g e_z (N, 3), body rates (N, 3), not linearised."""
        force, rates = felt(self.pose, self.velocity, self.acceleration, self.machine.head)
        return force - np.array([0.0, 0.0, GRAVITY]), rates


def assemble(
    name: str,
    machine: Machine,
    recording: Recording,
    rate: float,
    motion: tuple[Array, Array, Array],
    scale: float,
    vehicle_head: Array | None = None,
    periods: Periods | None = None,
) -> Drive:
    """Put executed poses, velocities and accelerations (N, 6) beside what was wanted."""
    pose, velocity, acceleration = motion
    times = np.arange(len(pose)) / rate
    force, rates = wanted_at(recording, times, scale, vehicle_head)
    return Drive(
        name,
        machine,
        rate,
        frozen(times),
        frozen(pose),
        frozen(velocity),
        frozen(acceleration),
        frozen(leg_lengths(machine, pose)),
        force,
        rates,
        periods,
    )


def no_motion(
    machine: Machine,
    recording: Recording,
    scale: float,
    rate: float = RATE_HZ,
    vehicle_head: Array | None = None,
) -> Drive:
    """The rival that stands still at neutral."""
    still = np.zeros((int(np.floor(recording.duration * rate + 1e-6)) + 1, 6))
    return assemble(
        "no motion", machine, recording, rate, (still, still, still), scale, vehicle_head
    )


def wanted_at(
    recording: Recording, times: Array, scale: float, vehicle_head: Array | None
) -> tuple[Array, Array]:
    """The reference of every figure: scale (f_head - g e_z) and scale x rates at ``times`` (N,).

    Taken from the recording itself (linear between its samples), so that whatever gate and intake
    lose or delay is charged to the server.
    """
    force = recording.force
    if vehicle_head is not None and np.any(vehicle_head):
        spin = np.gradient(recording.rates, recording.times, axis=0)
        force = transfer(force, recording.rates, spin, vehicle_head)
    force, rates = force - np.array([0.0, 0.0, GRAVITY]), recording.rates
    if recording.modes is not None:
        # while the simulation pauses there is nothing to feel
        still = np.array([mode in _STILL for mode in recording.modes])[:, None]
        force, rates = np.where(still, 0.0, force), np.where(still, 0.0, rates)
    columns = [np.interp(times, recording.times, c) for c in (*force.T, *rates.T)]
    both = scale * np.column_stack(columns)
    return frozen(both[:, :3]), frozen(both[:, 3:])
