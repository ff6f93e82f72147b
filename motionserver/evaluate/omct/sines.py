"""The ten tests of ICAO 9625 (volume I, attachment F) and their inputs.

A force input is a specific force of one axis. A turning input is a vehicle that turns about its
own point and stands otherwise: its attitude turns gravity, so that pitch and roll bring a specific
force along, as in life.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from motionserver.core.axes import Array
from motionserver.core.kinematics.rotation import gravity_in_body
from motionserver.evaluate.recording import Recording, from_samples

FREQUENCIES: Final = (
    0.100,
    0.158,
    0.251,
    0.398,
    0.631,
    1.000,
    1.585,
    2.512,
    3.981,
    6.310,
    10.00,
    15.849,
)
"""Of every test [rad/s]."""
FORCE: Final = 1.0
"""Amplitude of force inputs unless told otherwise [m/s2]."""
RATE: Final = 0.05
"""Amplitude of turning inputs [rad/s]."""
LARGEST_ANGLE: Final = 0.05
"""Below 1 rad/s the rate is less, so that the vehicle turns no further than this [rad]."""
PERIODS: Final = 3
"""Least number of settled periods that are judged."""
LEAST_WINDOW: Final = 4.0
"""Least time that is judged [s]."""
SETTLING: Final = (4.0, 15.0)
"""One period, but at least and at most this, is given to settle [s]."""
_SAMPLES_HZ: Final = 100.0


@dataclass(frozen=True, slots=True)
class Test:
    """One of the ten.

    Attributes:
        number: 1 to 10.
        title: Input and output.
        entry: Input: surge, sway, heave, roll, pitch or yaw.
        output: Signal that is judged: f_x, f_y, f_z, w_x, w_y, w_z, or "tilt_x", "tilt_y": the
            platform's attitude as the specific force it shows by gravity.
        against: Wanted signal it is divided by; 1 at 0 deg is perfect.
        direct: True if the output is the input's own axis.
    """

    number: int
    title: str
    entry: str
    output: str
    against: str
    direct: bool


TESTS: Final = (
    Test(1, "pitch to pitch rate", "pitch", "w_y", "w_y", True),
    Test(2, "pitch to surge force", "pitch", "f_x", "f_x", False),
    Test(3, "roll to roll rate", "roll", "w_x", "w_x", True),
    Test(4, "roll to sway force", "roll", "f_y", "f_y", False),
    Test(5, "yaw to yaw rate", "yaw", "w_z", "w_z", True),
    Test(6, "surge to surge force", "surge", "f_x", "f_x", True),
    Test(7, "surge to pitch, as the force it shows", "surge", "tilt_x", "f_x", False),
    Test(8, "sway to sway force", "sway", "f_y", "f_y", True),
    Test(9, "sway to roll, as the force it shows", "sway", "tilt_y", "f_y", False),
    Test(10, "heave to heave force", "heave", "f_z", "f_z", True),
)
ENTRIES: Final = ("surge", "sway", "heave", "roll", "pitch", "yaw")
"""Six inputs serve the ten tests."""


@dataclass(frozen=True, slots=True)
class Sine:
    """One input at one frequency.

    Attributes:
        entry: Which axis.
        omega: Frequency [rad/s].
        amplitude: Of the specific force [m/s2] or of the rate [rad/s].
        begin: When judging begins [s].
        end: When the drive ends [s]; a whole number of periods later.
    """

    entry: str
    omega: float
    amplitude: float
    begin: float
    end: float


def make_sine(entry: str, omega: float, force: float = FORCE) -> Sine:
    """Amplitude and times of one input at ``omega`` [rad/s]."""
    period = 2.0 * np.pi / omega
    settling = float(np.clip(period, *SETTLING))
    periods = max(PERIODS, int(np.ceil(LEAST_WINDOW / period)))
    turns = entry in ("roll", "pitch", "yaw")
    amplitude = min(RATE, LARGEST_ANGLE * omega) if turns else force
    return Sine(entry, omega, amplitude, settling, settling + periods * period)


def to_recording(sine: Sine) -> Recording:
    """The input as a drive; it swells within the first half of the settling time."""
    times = np.arange(int(np.ceil(sine.end * _SAMPLES_HZ)) + 1) / _SAMPLES_HZ
    swell = np.clip(times / (0.5 * sine.begin), 0.0, 1.0)
    swell = swell * swell * (3.0 - 2.0 * swell)
    wave = sine.amplitude * swell * np.sin(sine.omega * times)
    axis = ENTRIES.index(sine.entry)
    force, rates = np.zeros((len(times), 3)), np.zeros((len(times), 3))
    roll, pitch = np.zeros(len(times)), np.zeros(len(times))
    if axis < 3:
        force[:, axis] = wave
    else:
        # swelling angle, not rate: else a lasting tilt would remain
        angle = -sine.amplitude / sine.omega * swell * np.cos(sine.omega * times)
        rates[:, axis - 3] = np.gradient(angle, times)
        roll, pitch = (angle if sine.entry == name else 0.0 * angle for name in ("roll", "pitch"))
    force = force + gravity_in_body(roll, pitch)
    name = f"{sine.entry} at {sine.omega:g} rad/s"
    return from_samples(name, times, force, rates, np.full(len(times), 20.0))


def bin_of(signal: Array, times: Array, omega: float) -> complex:
    """The one bin of a Fourier sum at ``omega`` [rad/s]: a sin gives -1j a, a cos gives a.

    By least squares with a constant beside it, so that samples need not fit the period.
    """
    table = np.column_stack((np.cos(omega * times), np.sin(omega * times), np.ones(len(times))))
    found = np.linalg.lstsq(table, signal, rcond=None)[0]
    return complex(found[0], -found[1])


def tilt_shown(pose: Array) -> Array:
    """The force (N, 2) that the attitude of poses (N, 6) shows by gravity, x and y [m/s2]."""
    return gravity_in_body(pose[:, 3], pose[:, 4])[:, :2]
