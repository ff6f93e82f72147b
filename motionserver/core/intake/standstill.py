"""A vehicle that stands feels gravity and nothing else: whether the packets say so is checked."""

from __future__ import annotations

from collections import deque
from typing import Final

import numpy as np

from motionserver.core.axes import GRAVITY, Array
from motionserver.core.intake.freshness import MS, SECOND_NS
from motionserver.core.kinematics.rotation import gravity_in_body
from motionserver.core.state import DriveMode, VehicleMotion

TOLERANCE: Final = 0.5
"""Deviation of the specific force's magnitude from gravity at standstill [m/s2]."""
DIRECTION: Final = 1.5
"""Deviation of the specific force from gravity in the told attitude at standstill [m/s2]."""
STANDS_NS: Final = SECOND_NS
"""How long it must have stood [ns]."""
SLOW: Final = 0.1
"""Speed of a vehicle that stands [m/s]."""
CALM: Final = 0.05
"""Body rate of a vehicle that stands [rad/s]."""
STEADY: Final = 0.5
"""Spread of the specific force, each axis, of a vehicle that stands [m/s2]."""
_EVERY_NS: Final = 50 * MS
_FEWEST: Final = 6


class StandstillForce:
    """Judges the mean specific force of each second of standing.

    Attributes:
        complaint: What is wrong, with the remedy; stays until a standstill was right.
    """

    def __init__(self) -> None:
        """Begin without a packet."""
        self.complaint = ""
        self._since: int | None = None
        self._forces: deque[Array] = deque(maxlen=2 * STANDS_NS // _EVERY_NS)
        self._noted_ns = 0

    def heard(self, motion: VehicleMotion) -> None:
        """Note a packet."""
        if not _may_stand(motion):
            self._since = None
            return
        now = motion.arrival_ns
        if self._since is None:
            self._since = self._noted_ns = now
            self._forces.clear()
        elif now - self._noted_ns < _EVERY_NS:
            return
        self._noted_ns = now
        self._forces.append(motion.force)
        if now - self._since < STANDS_NS or len(self._forces) < _FEWEST:
            return
        forces = np.array(self._forces)
        if np.any(np.ptp(forces, axis=0) > STEADY):
            # it moves, whatever its speed says
            self._since = None
            return
        force = forces.mean(axis=0)
        if motion.speed_known or _counts_gravity_wrong(force):
            self.complaint = _judged(force, motion.attitude)
        self._since = now
        self._forces.clear()


def _may_stand(motion: VehicleMotion) -> bool:
    slow = not motion.speed_known or abs(motion.speed) <= SLOW
    return motion.mode is DriveMode.DRIVE and slow and bool(np.all(np.abs(motion.rates) <= CALM))


def _counts_gravity_wrong(force: Array) -> bool:
    """Without a speed only gravity that is missing or counted twice is told from a steady drive."""
    size = float(np.linalg.norm(force))
    return size < TOLERANCE or abs(size - 2.0 * GRAVITY) < TOLERANCE


def _judged(force: Array, attitude: tuple[float, float] | None) -> str:
    size = float(np.linalg.norm(force))
    if abs(size - GRAVITY) > TOLERANCE:
        return (
            f"at standstill the specific force is {size:.2f} m/s2, it must be {GRAVITY} within "
            f"{TOLERANCE}: {_cause(size)}"
        )
    gravity = np.array([0.0, 0.0, GRAVITY])
    if attitude is not None:
        gravity = gravity_in_body(np.array(attitude[0]), np.array(attitude[1]))
    if attitude is None and force[2] > 0.0:
        return ""
    if float(np.linalg.norm(force - gravity)) <= DIRECTION:
        return ""
    told = ", ".join(f"{value:.2f}" for value in force)
    asked = ", ".join(f"{value:.2f}" for value in gravity)
    return (
        f"at standstill the specific force is ({told}) m/s2, in the told attitude it must be "
        f"({asked}): check axes and signs (x forward, y left, z up; roll positive left side up, "
        f"pitch positive nose down)"
    )


def _cause(size: float) -> str:
    if abs(size - 2.0 * GRAVITY) < 1.0:
        return (
            "gravity is counted twice. The values contain it: set the flag GRAVITY_INCLUDED "
            "(Python: send specific_force=), or send acceleration that is zero at rest"
        )
    if size < 1.0 and abs(size - 1.0) > 0.1:
        return (
            "gravity is missing. Clear the flag GRAVITY_INCLUDED if the values do not contain it "
            "(Python: send acceleration=); if they do, z must point up"
        )
    if abs(size - 1.0) <= 0.1:
        return "is it sent in g? It must be in m/s2"
    return "check the unit (m/s2) and whether the flag GRAVITY_INCLUDED is true"
