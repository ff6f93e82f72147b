"""Measured acceleration: the slow disturbance estimate and the monitor of tracking."""

from __future__ import annotations

from math import exp, pi
from typing import Final

import numpy as np

from motionserver.core.axes import Array, frozen

CORNER_HZ: Final = 1.0
"""Corner of the low-pass of the estimate [Hz]."""
MOST: Final = 0.3
"""Largest disturbance that is believed, each axis [m/s2]."""
ALARM: Final = 1.5
"""Slow mismatch that means the sensor or the platform is wrong [m/s2]."""


def believed(disturbance: Array) -> Array:
    """A disturbance (3,) as an algorithm may use it: what is no number is none, and bounded."""
    return np.clip(np.nan_to_num(disturbance), -MOST, MOST)


class MeasuredForce:
    """What the platform's own accelerometer says against what the plan should give.

    The measurement never replaces the model state: raw substitution breaks the limits. It enters
    as a slow output disturbance d = lowpass(measured - model), clipped.
    """

    def __init__(self) -> None:
        self._mean = np.zeros(3)
        self._power = 0.0
        self.latest: Array | None = None

    def update(self, measured: Array, model: Array, dt: float) -> None:
        """Take one sample.

        Args:
            measured: Specific force at the head, gravity included, (3,) [m/s2].
            model: What the played plan gives there, (3,) [m/s2].
            dt: Time since the last sample [s].
        """
        share = 1.0 - exp(-2.0 * pi * CORNER_HZ * dt)
        error = measured - model
        self._mean = self._mean + share * (error - self._mean)
        self._power += share * (float(error @ error) - self._power)
        self.latest = frozen(measured)

    def lost(self) -> None:
        """No measurement any more: forget, at once for the curve and slowly for the estimate."""
        self.latest = None
        self._mean = 0.98 * self._mean
        self._power *= 0.98

    @property
    def disturbance(self) -> Array:
        """Estimate d, (3,) [m/s2]; zero while the mismatch is beyond belief."""
        if self.alarm:
            return frozen(np.zeros(3))
        return frozen(np.clip(self._mean, -MOST, MOST))

    @property
    def mismatch(self) -> float:
        """Root mean square of measured minus model [m/s2]."""
        return float(np.sqrt(self._power))

    @property
    def alarm(self) -> bool:
        """True when measurement and model disagree so far that the sensor must be looked at."""
        return float(np.max(np.abs(self._mean))) > ALARM
