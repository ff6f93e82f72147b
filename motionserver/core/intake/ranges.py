"""What no vehicle does, what is no number, what is no attitude: such packets are not used."""

from __future__ import annotations

from math import pi
from typing import Final

import numpy as np

from motionserver.core.axes import GRAVITY, Array
from motionserver.core.state import VehicleMotion

IMPLAUSIBLE_FORCE: Final = 10.0 * GRAVITY
"""Specific force no road vehicle survives: the packet is not believed [m/s2]."""
IMPLAUSIBLE_RATE: Final = np.radians(4000.0)
"""Body rate beyond every vehicle: the packet is not believed [rad/s]."""
FASTEST: Final = 1000.0
"""Speed beyond every vehicle: the packet is not believed [m/s]."""
FARTHEST: Final = 60.0
"""A preview beyond this is not believed [s]."""
ROLL_MOST: Final = pi
PITCH_MOST: Final = pi / 2.0
_ROUNDING: Final = 1e-6
"""The nearest binary32 lies above pi and above half of it [rad]."""


def out_of_range(motion: VehicleMotion) -> str:
    """What is wrong with a packet's values, with the remedy; empty if nothing is."""
    if motion.attitude is not None:
        roll, pitch = motion.attitude
        for name, angle, most, text in (
            ("roll", roll, ROLL_MOST, "pi"),
            ("pitch", pitch, PITCH_MOST, "pi/2"),
        ):
            if not abs(angle) <= most + _ROUNDING:
                return f"{name} {angle:.4g} rad is beyond {text}, no attitude: is it in degrees?"
    if not _is_within(motion.force, IMPLAUSIBLE_FORCE):
        force = _shown(motion.force)
        return f"specific force {force} m/s2 is beyond 10 g: is it sent in m/s2?"
    if not _is_within(motion.rates, IMPLAUSIBLE_RATE):
        return f"body rates {_shown(motion.rates)} rad/s are beyond 4000 deg/s: are they in rad/s?"
    if not abs(motion.speed) <= FASTEST:
        return f"speed {motion.speed:.4g} m/s is beyond {FASTEST:.0f} m/s: is it sent in m/s?"
    preview = motion.preview
    if preview is None:
        return ""
    times = preview.times
    if not (times[0] >= 0.0 and times[-1] <= FARTHEST and np.all(np.diff(times) > 0.0)):
        return f"preview times must rise from 0 to at most {FARTHEST:.0f} s"
    if not _is_within(preview.force, IMPLAUSIBLE_FORCE):
        return "preview: a specific force is beyond 10 g: is it sent in m/s2?"
    if not _is_within(preview.rates, IMPLAUSIBLE_RATE):
        return "preview: a body rate is beyond 4000 deg/s: is it sent in rad/s?"
    return ""


def _is_within(values: Array, most: float) -> bool:
    # asked so that a NaN is outside
    return bool(np.all(np.abs(values) <= most))


def _shown(values: Array) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in values) + ")"
