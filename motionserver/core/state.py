"""What flows along the straight line: vehicle motion, stimulus, platform state."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from motionserver.core.axes import Array, frozen


class DriveMode(IntEnum):
    """What the simulator says it is doing."""

    DRIVE = 0
    PAUSE = 1
    TELEPORT = 2
    BYE = 3


@dataclass(frozen=True, slots=True)
class Preview:
    """What the simulator expects to come.

    Attributes:
        times: Seconds after the sample it came with, (n,), increasing [s].
        force: Specific force, gravity included, (n, 3) [m/s2].
        rates: Body rates, (n, 3) [rad/s].
    """

    times: Array
    force: Array
    rates: Array


@dataclass(frozen=True, slots=True)
class Driver:
    """What the driver does at the controls.

    Attributes:
        throttle: 0 released to 1 floored.
        brake: 0 released to 1 full.
        clutch: 0 released to 1 pressed.
        steering: Steering wheel angle, positive to the left [rad].
        gear: -1 reverse, 0 neutral, 1 first and so on.
    """

    throttle: float
    brake: float
    clutch: float
    steering: float
    gear: int


@dataclass(frozen=True, slots=True)
class VehicleMotion:
    """One decoded sample of a simulator, SI and ISO 8855.

    Attributes:
        arrival_ns: When it arrived here, CLOCK_MONOTONIC [ns].
        session: Number the sender chose for its run; a new one means a new drive.
        sequence: Counter of the sender, or None if its format has none.
        sender_ns: The sender's own steady clock [ns], or None if its format has none.
        force: Specific force at the sent point, gravity included, (3,) [m/s2].
        rates: Body rates, (3,) [rad/s].
        speed: Forward speed [m/s].
        mode: Driving, paused, teleported or leaving.
        at_platform: True if measured on the platform by an inertial sensor.
        preview: What comes next, if the sender knows.
        driver: What the driver does, if the sender tells.
        sim_time_ns: The simulation's own time of the values [ns]; 0 if its format has none.
        attitude: Roll and pitch that the sender tells [rad], or None if it tells none.
        speed_known: True if the sender tells the speed.
    """

    arrival_ns: int
    session: int
    sequence: int | None
    sender_ns: int | None
    force: Array
    rates: Array
    speed: float = 0.0
    mode: DriveMode = DriveMode.DRIVE
    at_platform: bool = False
    preview: Preview | None = None
    driver: Driver | None = None
    sim_time_ns: int = 0
    attitude: tuple[float, float] | None = None
    speed_known: bool = False


@dataclass(frozen=True, slots=True)
class Stimulus:
    """What the person should feel now: scaled, at the head, faded, made safe to use.

    Attributes:
        force: Wanted specific force at the head minus g e_z, scaled and faded, (3,) [m/s2].
        rates: Wanted body rates, scaled and faded, (3,) [rad/s].
        gain: The fade already contained in both, 0..1 [-].
        preview: Future of the same quantities, times from now; None without preview.
        share: Factor contained in force and rates, fade times scale [-]; what the vehicle really
            does is force / share, while share is above 0.
        speed: Forward speed of the vehicle, not scaled [m/s].
        driver: What its driver does, not scaled; None if the simulator does not tell.
    """

    force: Array
    rates: Array
    gain: float = 1.0
    preview: Preview | None = None
    share: float = 1.0
    speed: float = 0.0
    driver: Driver | None = None


@dataclass(frozen=True, slots=True)
class PlatformState:
    """Pose of the platform and its derivatives, each (6,), in the order of `Axis`.

    Attributes:
        pose: Surge, sway, heave [m], roll, pitch, yaw [rad] from neutral (Rz Ry Rx).
        velocity: Time derivative of the pose coordinates.
        acceleration: Second time derivative of the pose coordinates.
    """

    pose: Array
    velocity: Array
    acceleration: Array

    @classmethod
    def at_rest(cls, pose: Array) -> PlatformState:
        """A platform that stands at ``pose`` (6,)."""
        return cls(frozen(pose), frozen(np.zeros(6)), frozen(np.zeros(6)))


STILL = Stimulus(frozen(np.zeros(3)), frozen(np.zeros(3)), 0.0)
"""Nothing to feel: the cabin stands level."""
