"""A packet of the simulator as fields of a recording, see `recorded.CUE`."""

from __future__ import annotations

import numpy as np

from motionserver.core.axes import Array
from motionserver.core.kinematics.rotation import gravity_in_body
from motionserver.core.state import VehicleMotion


def cue_row(time: float, motion: VehicleMotion) -> list[str]:
    """The fields, for a packet of this instant [s]; empty where the sender told nothing."""
    roll, pitch = motion.attitude or (0.0, 0.0)
    gravity: Array = gravity_in_body(np.array(roll), np.array(pitch))
    driver = [""] * 5
    if motion.driver is not None:
        told = motion.driver
        pedals = (told.throttle, told.brake, told.clutch, told.steering)
        driver = [*(f"{value:.5g}" for value in pedals), str(told.gear)]
    return [
        f"{time:.6f}",
        *(f"{value:.6f}" for value in motion.force - gravity),
        *(f"{value:.7f}" for value in motion.rates),
        f"{motion.speed:.5f}",
        f"{roll:.7f}",
        f"{pitch:.7f}",
        motion.mode.name.lower(),
        *driver,
        "" if motion.sender_ns is None else _seconds(motion.sender_ns),
        _seconds(motion.sim_time_ns) if motion.sim_time_ns else "",
        _preview(motion, gravity),
    ]


def _seconds(time_ns: int) -> str:
    return f"{time_ns // 1_000_000_000}.{time_ns % 1_000_000_000:09d}"


def _preview(motion: VehicleMotion, gravity: Array) -> str:
    if motion.preview is None:
        return ""
    ahead = motion.preview
    table = np.column_stack((ahead.times, ahead.force - gravity, ahead.rates))
    return " / ".join(" ".join(f"{value:.5g}" for value in row) for row in table)
