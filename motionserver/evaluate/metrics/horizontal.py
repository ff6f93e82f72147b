"""Surge and sway together: the few figures by which algorithms are compared."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from motionserver.core.axes import Array
from motionserver.evaluate.metrics.fidelity import CORNERS_HZ, FORCE_THRESHOLD, ratio
from motionserver.evaluate.metrics.linear import bands, rms

SILENT: Final = 0.05 * FORCE_THRESHOLD
"""Wanted force below which a share of it says nothing [m/s2]."""


@dataclass(frozen=True, slots=True)
class HorizontalFigures:
    """Figures of f_x and f_y as one vector; None where nothing is wanted.

    Attributes:
        nrmse: RMSE over the rms of the reference; 0 is perfect, 1 is no motion.
        low: Same below 0.1 Hz.
        mid: Same between 0.1 and 0.5 Hz.
        onset: Same above 0.5 Hz.
        perceived: Same after the otoliths.
        correlation: Of felt and wanted at zero lag, both axes pooled; None if nothing is felt.
    """

    nrmse: float | None
    low: float | None
    mid: float | None
    onset: float | None
    perceived: float | None
    correlation: float | None


def horizontal_figures(
    wanted: Array, felt: Array, sensed_wanted: Array, sensed_felt: Array, dt: float
) -> HorizontalFigures:
    """Judge forces of x and y, each (N, 2); ``dt`` [s] between samples."""
    error = felt - wanted
    low, mid, onset = (
        ratio(rms(e), rms(r), SILENT)
        for e, r in zip(bands(error, dt, CORNERS_HZ), bands(wanted, dt, CORNERS_HZ), strict=True)
    )
    return HorizontalFigures(
        ratio(rms(error), rms(wanted), SILENT),
        low,
        mid,
        onset,
        ratio(rms(sensed_felt - sensed_wanted), rms(sensed_wanted), SILENT),
        _pooled(wanted, felt) if rms(wanted) >= SILENT else None,
    )


def _pooled(wanted: Array, felt: Array) -> float | None:
    r, y = wanted - wanted.mean(axis=0), felt - felt.mean(axis=0)
    power = float(np.sum(r * r)) * float(np.sum(y * y))
    return float(np.sum(r * y)) / power**0.5 if power > 1e-20 else None
