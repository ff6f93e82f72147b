"""A drive made from physics, for tests: known motion, and what sensors read of it.

Nothing here comes from the code under test: rates by the Euler angles' kinematics, specific force
by the formula in the recordings' README.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from .signals import Array


class Motion(NamedTuple):
    """Vehicle axes: forward, left, up."""

    t: Array
    speed: Array
    heading: Array
    """Counter-clockwise from east [rad]."""
    forward: Array
    left: Array
    up: Array
    rates: Array
    roll: Array
    pitch: Array
    force: Array
    """Specific force at rest: 0, 0, 9.81."""
    east: Array
    north: Array


@cache
def drive(rate: float, seconds: float = 100.0, one_sided: bool = False) -> Motion:
    """Start, left and right turns (`one_sided`: left only), brakings, a stop, and once more."""
    fine = np.arange(0.0, seconds, 1e-3)
    forward = sum(
        size * _pulse(fine, at, length)
        for size, at, length in (
            (2.0, 6.0, 8.0),
            (-3.0, 40.0, 4.0),
            (1.5, 46.0, 4.0),
            (-1.0, 60.0, 7.0),
            (2.2, 72.0, 6.0),
            (-2.5, 88.0, 4.0),
        )
    )
    speed = np.cumsum(forward) * 1e-3
    turning = sum(
        size * _pulse(fine, at, length)
        for size, at, length in (
            (0.45, 16.0, 6.0),
            (-0.35, 26.0, 6.0),
            (0.5, 33.0, 5.0),
            (-0.6, 51.0, 6.0),
            (0.4, 79.0, 6.0),
        )
    )
    if one_sided:
        turning = np.abs(turning)
    heading = 0.3 + np.cumsum(turning) * 1e-3
    left = speed * turning
    # braking dips the nose, a left turn lifts the left side; the road rises and leans slowly
    pitch = -0.006 * forward - 0.02 * np.sin(2.0 * np.pi * fine / 60.0)
    roll = 0.008 * left + 0.015 * np.sin(2.0 * np.pi * fine / 45.0)
    up = 0.4 * np.sin(2.0 * np.pi * 1.5 * fine) * (speed > 1.0)
    roll_dot, pitch_dot = np.gradient(roll, 1e-3), np.gradient(pitch, 1e-3)
    rates = np.column_stack(
        [
            roll_dot - turning * np.sin(pitch),
            pitch_dot * np.cos(roll) + turning * np.sin(roll) * np.cos(pitch),
            -pitch_dot * np.sin(roll) + turning * np.cos(roll) * np.cos(pitch),
        ]
    )
    force = np.column_stack(
        [
            forward - 9.81 * np.sin(pitch),
            left + 9.81 * np.sin(roll) * np.cos(pitch),
            up + 9.81 * np.cos(roll) * np.cos(pitch),
        ]
    )
    east = np.cumsum(speed * np.cos(heading)) * 1e-3
    north = np.cumsum(speed * np.sin(heading)) * 1e-3
    times = np.arange(0.0, seconds - 0.01, 1.0 / rate)
    at = np.round(times * 1e3).astype(int)
    signals = (speed, heading, forward, left, up, rates, roll, pitch, force, east, north)
    return Motion(times, *(signal[at] for signal in signals))


def _pulse(t: Array, at: float, length: float) -> Array:
    """One raised cosine of height 1."""
    phase = np.clip((t - at) / length, 0.0, 1.0)
    return 0.5 - 0.5 * np.cos(2.0 * np.pi * phase)
