"""What the person notices besides the cue: incongruence, tilt, washout against the cue."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from motionserver.core.axes import Array
from motionserver.evaluate.metrics.fidelity import FORCE_THRESHOLD, RATE_THRESHOLD
from motionserver.evaluate.metrics.linear import lag

LATERAL_SHARE: Final = 0.66
"""Weight of the lateral mismatch in the rating (Kolff et al.); the rest is longitudinal."""
RATING_TAU: Final = 1.0
"""Time constant of the rating's low-pass [s]; an assumption, theirs could not be read."""


@dataclass(frozen=True, slots=True)
class ComfortFigures:
    """Noticed over the whole drive.

    Attributes:
        rating_peak: Largest motion-incongruence rating [m/s2].
        rating_mean: Mean of it [m/s2].
        tilt_rate_max: Largest roll or pitch rate beyond the wanted one [rad/s].
        tilt_rate_p99: Its 99th percentile [rad/s].
        tilt_share: Share of time above 3 deg/s.
        washout_max: Largest acceleration of the platform against the cue, x or y [m/s2].
        washout_share: Share of time above 0.1 m/s2.
    """

    rating_peak: float
    rating_mean: float
    tilt_rate_max: float
    tilt_rate_p99: float
    tilt_share: float
    washout_max: float
    washout_share: float


def rating(error: Array, dt: float) -> Array:
    """Motion-incongruence rating over time (N,) of force errors (N, 3) [m/s2]."""
    size = np.abs(error)
    mismatch: Array = LATERAL_SHARE * size[:, 1] + (1.0 - LATERAL_SHARE) * size[:, 0]
    return lag(np.concatenate(([0.0], mismatch)), RATING_TAU, dt)[1:]


def tilt_rate(wanted_rates: Array, felt_rates: Array) -> Array:
    """Roll and pitch rate that nobody asked for, its size over time (N,) [rad/s].

    Per axis the part of the felt rate that is against the wanted one or goes beyond it: that is
    tilt coordination, as distinct from the vehicle's own turning.
    """
    w, y = wanted_rates[:, :2], felt_rates[:, :2]
    asked = np.clip(y, np.minimum(w, 0.0), np.maximum(w, 0.0))
    size: Array = np.hypot(*(y - asked).T)
    return size


def washout_against(wanted_force: Array, acceleration: Array) -> Array:
    """Translational acceleration against the wanted force, x and y, (N, 2) [m/s2]."""
    along = acceleration[:, :2] * np.sign(wanted_force[:, :2])
    return np.where(along < 0.0, -along, 0.0)


def comfort_figures(
    wanted_force: Array,
    wanted_rates: Array,
    felt_force: Array,
    felt_rates: Array,
    acceleration: Array,
    dt: float,
) -> ComfortFigures:
    """Judge forces and rates (N, 3) and the platform's acceleration (N, 6)."""
    rated = rating(felt_force - wanted_force, dt)
    tilting = tilt_rate(wanted_rates, felt_rates)
    against = washout_against(wanted_force, acceleration).max(axis=1)
    return ComfortFigures(
        float(rated.max()),
        float(rated.mean()),
        float(tilting.max()),
        float(np.percentile(tilting, 99)),
        float(np.mean(tilting > RATE_THRESHOLD)),
        float(against.max()),
        float(np.mean(against > FORCE_THRESHOLD)),
    )
