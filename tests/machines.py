"""Machines that tests share: the shipped preset, and the fixture with published anchor lengths."""

from functools import cache

import numpy as np

from motionserver.core.axes import frozen
from motionserver.core.limits import Machine, Pace
from motionserver.settings.machine import load_machine


@cache
def compact() -> Machine:
    return load_machine("t2-compact")


def _circle(radius, angles, z):
    return [[radius * np.cos(a), radius * np.sin(a), z] for a in angles]


@cache
def science_fit() -> Machine:
    """Pairs of base joints at 0, 120, 240 deg, of platform joints at 60, 180, 300 deg."""
    base, top, third = 0.2475, 0.0431, 2 * np.pi / 3
    return Machine(
        name="science-fit",
        base_joints=frozen(
            _circle(0.694, [k * third + s * base for k in range(3) for s in (-1, 1)], 0.0)
        ),
        platform_joints=frozen(
            _circle(
                0.753,
                [
                    -third / 2 + top,
                    third / 2 - top,
                    third / 2 + top,
                    np.pi - top,
                    np.pi + top,
                    5 * third / 2 - top,
                ],
                0.0,
            )
        ),
        neutral_height=0.5273,
        leg_min=0.60078,
        leg_max=0.90478,
        leg_speed=0.6,
        leg_acceleration=8.0,
        leg_jerk=None,
        joint_angle=None,
        conditioning=None,
        passenger_acceleration=None,
        head=frozen([0.0, 0.0, 1.2]),
        parked_pose=frozen([0.0, 0.0, -0.15, 0.0, 0.0, 0.0]),
        box=frozen([0.198, 0.220, 0.200, *np.radians([17.5, 16.3, 17.5])]),
        pace=Pace(0.15, 0.5, 2.0),
    )
