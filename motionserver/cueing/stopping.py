"""The smooth stop every plan ends with."""

from __future__ import annotations

from typing import Final

import numpy as np

from motionserver.core.axes import Array

STOP_TIME: Final = 0.4
"""How long the stop at the end of a plan takes [s]."""


def rest_gains(duration: float) -> Array:
    """Where a stop ends: pose + v T/2 + a T2/12, the gains of (pose, v, a), (3,).

    The speed goes to zero as a cubic that meets speed and acceleration at both ends; the pose is
    then a quartic, which the quintic between two knots of a plan is in this case.
    """
    return np.array([1.0, duration / 2.0, duration**2 / 12.0])


def with_stop(
    times: Array, pose: Array, velocity: Array, acceleration: Array, duration: float
) -> tuple[Array, Array, Array, Array]:
    """Append the knot at rest.

    Args:
        times: (K,) [s].
        pose: (K, 6).
        velocity: (K, 6).
        acceleration: (K, 6).
        duration: How long the stop takes [s].

    Returns:
        The four tables with one more row.
    """
    gains = rest_gains(duration)
    end = gains[0] * pose[-1] + gains[1] * velocity[-1] + gains[2] * acceleration[-1]
    still = np.zeros((1, pose.shape[1]))
    return (
        np.append(times, times[-1] + duration),
        np.concatenate((pose, end[None])),
        np.concatenate((velocity, still)),
        np.concatenate((acceleration, still)),
    )
