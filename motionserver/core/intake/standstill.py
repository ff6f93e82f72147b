"""A vehicle that stands feels gravity and nothing else: whether the packets say so is checked."""

from __future__ import annotations

from dataclasses import dataclass, field
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
"""How long it must have stood, or moved unaccelerated at an unknown speed [ns]."""
MOVES_NS: Final = 3 * SECOND_NS
"""How long a vehicle that moves must have felt the same, without turning [ns]."""
SLOW: Final = 0.1
"""Speed of a vehicle that stands [m/s]."""
CALM: Final = 0.05
"""Body rate of a vehicle that stands [rad/s]."""
STEADY: Final = 0.5
"""Spread of the specific force, each axis, of a vehicle that stands [m/s2]."""
_EVERY_NS: Final = 50 * MS
_FEWEST: Final = 6


@dataclass(slots=True)
class _Stretch:
    """What was felt while the vehicle stood, or moved without turning."""

    moves: bool
    since_ns: int
    noted_ns: int
    forces: list[Array] = field(default_factory=list)


class StandstillForce:
    """Judges the mean specific force of each second of standing.

    Attributes:
        complaint: What is wrong, with the remedy; stays until a standstill was right.
    """

    def __init__(self) -> None:
        """Begin without a packet."""
        self.complaint = ""
        self._stretch: _Stretch | None = None

    def heard(self, motion: VehicleMotion) -> None:
        """Note a packet."""
        if motion.mode is not DriveMode.DRIVE or np.any(np.abs(motion.rates) > CALM):
            self._stretch = None
            return
        now = motion.arrival_ns
        moves = motion.speed_known and abs(motion.speed) > SLOW
        stretch = self._stretch
        if stretch is None or moves is not stretch.moves:
            stretch = self._stretch = _Stretch(moves, now, now)
        elif now - stretch.noted_ns < _EVERY_NS:
            return
        stretch.noted_ns = now
        stretch.forces.append(motion.force)
        least_ns = MOVES_NS if moves else STANDS_NS
        if now - stretch.since_ns < least_ns or len(stretch.forces) < _FEWEST:
            return
        forces = np.array(stretch.forces)
        if np.any(np.ptp(forces, axis=0) > STEADY):
            # it moves, whatever its speed says
            self._stretch = None
            return
        force = forces.mean(axis=0)
        if (motion.speed_known and not moves) or _counts_gravity_wrong(force):
            self.complaint = _judged(force, motion.attitude, moves)
        self._stretch = _Stretch(moves, now, now)


def _counts_gravity_wrong(force: Array) -> bool:
    """Unless it stands, only gravity that is missing or counted twice is told from a drive."""
    size = float(np.linalg.norm(force))
    return size < TOLERANCE or abs(size - 2.0 * GRAVITY) < TOLERANCE


def _judged(force: Array, attitude: tuple[float, float] | None, moves: bool) -> str:
    size = float(np.linalg.norm(force))
    if abs(size - GRAVITY) > TOLERANCE:
        when = "in steady straight motion" if moves else "at standstill"
        return (
            f"{when} the specific force is {size:.2f} m/s2, it must be {GRAVITY} within "
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
    if size < 0.9:
        return (
            "gravity is missing. Clear the flag GRAVITY_INCLUDED if the values do not contain it "
            "(Python: send acceleration=); if they do, z must point up"
        )
    if size <= 1.1:
        return "is it sent in g? It must be in m/s2"
    return "check the unit (m/s2) and whether the flag GRAVITY_INCLUDED is true"
