"""Leg-length rows, linearised about the remainder of the accepted plan."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from motionserver.core.axes import Array
from motionserver.core.kinematics.hexapod import jacobian, leg_lengths
from motionserver.core.limits import Machine

MARGIN_NOW: Final = 0.001
"""Kept from the ends of the stroke at the hand-over [m]."""
MARGIN_END: Final = 0.007
"""And at the end of the horizon, where the linearisation is less true [m]."""
MARGIN_HOME: Final = 0.003
"""Kept on the way home [m]."""
WAY_HOME: Final = np.array([0.35, 0.55, 0.75])
"""Share of the rest pose at the instants looked at on the way home [-]."""


@dataclass(frozen=True, slots=True)
class LegRows:
    """sign (J q) <= room, for the nearer end of each leg's stroke.

    Attributes:
        gradient: sign J, (N, 6 legs, 6 axes) [m per m or rad].
        room: What sign (J q) may be, (N, 6) [m].
    """

    gradient: Array
    room: Array


def leg_rows(machine: Machine, nominal: Array, margins: Array) -> LegRows:
    """Linearise l(q) ~ l(n) + J(n) (q - n) about nominal poses.

    Args:
        machine: Geometry.
        nominal: Poses n, (N, 6).
        margins: What is kept from the ends of the stroke, (N,) [m].
    """
    lengths = leg_lengths(machine, nominal)
    gradient = jacobian(machine, nominal)
    middle = 0.5 * (machine.leg_min + machine.leg_max)
    half = 0.5 * (machine.leg_max - machine.leg_min)
    side = np.where(lengths >= middle, 1.0, -1.0)
    signed = side[..., None] * gradient
    along = np.einsum("nla,na->nl", signed, nominal)
    room = half - margins[:, None] - side * (lengths - middle) + along
    return LegRows(signed, room)


def margins_over(looks: Array) -> Array:
    """Margin at each look, growing evenly over the horizon, and on the way home, (N + W,) [m]."""
    grown = MARGIN_NOW + (MARGIN_END - MARGIN_NOW) * looks / looks[-1]
    return np.concatenate((grown, np.full(len(WAY_HOME), MARGIN_HOME)))


def with_way_home(poses: Array, home: Array) -> Array:
    """Append poses on the straight way from the last pose, the one at rest, to ``home``.

    A plan from whose end there is no straight way home is not accepted; that is linear in the end
    pose, so the programme can see to it.

    Args:
        poses: (N, 6).
        home: Where the platform is parked, (6,).
    """
    return np.concatenate((poses, home + WAY_HOME[:, None] * (poses[-1] - home)))


def way_home_gains(gains: Array) -> Array:
    """What `with_way_home` does to derivatives: (N, 6, n) -> (N + W, 6, n)."""
    return np.concatenate((gains, WAY_HOME[:, None, None] * gains[-1]))
