"""How close the felt motion comes to the wanted one, axis by axis."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from typing import Final

import numpy as np

from motionserver.core.axes import Array
from motionserver.evaluate.metrics.linear import bands, rms

CORNERS_HZ: Final = (0.1, 0.5)
"""Borders of the low, middle and onset bands [Hz]."""
LAGS: Final = (-0.2, 1.0)
"""Delays of the felt behind the wanted motion that are tried [s]."""
FORCE_THRESHOLD: Final = 0.1
"""Specific force below which nothing is felt [m/s2] (Table 1 of Thoendel 2014)."""
RATE_THRESHOLD: Final = radians(3.0)
"""Rate below which nothing is felt [rad/s] (ibid.)."""
_LAG_STEP: Final = 0.005
_SILENT: Final = 0.05
"""Share of the threshold below which a wanted signal is none, and a ratio to it says nothing."""


@dataclass(frozen=True, slots=True)
class AxisFigures:
    """Figures of one axis; None where the wanted or the felt signal is nothing.

    Attributes:
        axis: f_x, f_y, f_z [m/s2], w_x, w_y or w_z [rad/s].
        wanted_rms: Of the reference.
        rmse: Of the error.
        nrmse: rmse / wanted_rms; 0 is perfect, 1 is no motion.
        nrmse_low: Same below 0.1 Hz.
        nrmse_mid: Same between 0.1 and 0.5 Hz.
        nrmse_onset: Same above 0.5 Hz.
        correlation: At zero lag.
        lag: Delay of the felt motion with the largest correlation [s].
        lag_correlation: Correlation there.
        gain: k of the least squares y = k r(t - lag).
        r2: Share of the felt motion's power that this explains.
        false_cue: Area of cues of the wrong sign or out of nothing over the area wanted.
        false_share: Share of time in which there is one.
        missing_cue: Area of wanted cues of which nothing is felt over the area wanted.
        perceived_nrmse: nrmse after canals or otoliths.
    """

    axis: str
    wanted_rms: float
    rmse: float
    nrmse: float | None
    nrmse_low: float | None
    nrmse_mid: float | None
    nrmse_onset: float | None
    correlation: float | None
    lag: float | None
    lag_correlation: float | None
    gain: float | None
    r2: float | None
    false_cue: float | None
    false_share: float
    missing_cue: float | None
    perceived_nrmse: float | None


def axis_figures(
    axis: str,
    wanted: Array,
    felt: Array,
    sensed_wanted: Array,
    sensed_felt: Array,
    dt: float,
    threshold: float,
) -> AxisFigures:
    """Judge one axis.

    Args:
        axis: Its name.
        wanted: Reference r, (N,).
        felt: Produced y, (N,).
        sensed_wanted: r after the organ, (N,).
        sensed_felt: y after the organ, (N,).
        dt: Spacing of the samples [s].
        threshold: Below it nothing is felt.

    Returns:
        All figures of the axis.
    """
    error = felt - wanted
    floor = _SILENT * threshold
    low, mid, onset = (
        ratio(rms(e), rms(r), floor)
        for e, r in zip(bands(error, dt, CORNERS_HZ), bands(wanted, dt, CORNERS_HZ), strict=True)
    )
    delay, best, now = best_lag(wanted, felt, dt)
    gain, r2 = scale_of(wanted, felt, delay, dt) if delay is not None else (None, None)
    false_cue, false_share, missing = cue_indices(wanted, felt, threshold)
    audible = rms(wanted) >= floor
    return AxisFigures(
        axis,
        rms(wanted),
        rms(error),
        ratio(rms(error), rms(wanted), floor),
        low,
        mid,
        onset,
        now if audible else None,
        delay if audible else None,
        best if audible else None,
        gain if audible else None,
        r2 if audible else None,
        false_cue if audible else None,
        false_share,
        missing if audible else None,
        ratio(rms(sensed_felt - sensed_wanted), rms(sensed_wanted), floor),
    )


def ratio(part: float, whole: float, floor: float) -> float | None:
    """Share ``part / whole``, or None if the whole is below the floor."""
    return part / whole if whole >= max(floor, 1e-12) else None


def correlation(a: Array, b: Array) -> float | None:
    """Pearson's correlation of (N,) and (N,); None if one of them stands still."""
    a, b = a - a.mean(), b - b.mean()
    power = float(a @ a) * float(b @ b)
    return float(a @ b) / power**0.5 if power > 1e-20 else None


def best_lag(
    wanted: Array, felt: Array, dt: float
) -> tuple[float | None, float | None, float | None]:
    """The delay in `LAGS` with the largest correlation, that correlation, and the one at zero."""
    now = correlation(wanted, felt)
    if now is None:
        return None, None, None
    stride = max(1, round(_LAG_STEP / dt))
    r, y, step = wanted[::stride], felt[::stride], dt * stride
    best, delay = -2.0, 0
    for shift in range(round(LAGS[0] / step), round(LAGS[1] / step) + 1):
        if abs(shift) > len(r) // 2:
            continue
        a, b = (r[: len(r) - shift], y[shift:]) if shift >= 0 else (r[-shift:], y[:shift])
        value = correlation(a, b)
        if value is not None and value > best + 1e-12:
            best, delay = value, shift
    return delay * step, best, now


def scale_of(wanted: Array, felt: Array, delay: float, dt: float) -> tuple[float, float]:
    """Least squares y = k r(t - delay): k, and R2 = 1 - |y - k r|^2 / |y|^2."""
    shift = round(delay / dt)
    count = len(wanted)
    r, y = (
        (wanted[: count - shift], felt[shift:])
        if shift >= 0
        else (
            wanted[-shift:],
            felt[:shift],
        )
    )
    k = float(r @ y) / max(float(r @ r), 1e-30)
    return k, 1.0 - float(np.sum((y - k * r) ** 2)) / max(float(y @ y), 1e-30)


def cue_indices(
    wanted: Array, felt: Array, threshold: float
) -> tuple[float | None, float, float | None]:
    """False-cue index, share of time with a false cue, missing-cue index."""
    size, ask = np.abs(felt), np.abs(wanted)
    false = ((felt * wanted < 0.0) | (ask < threshold)) & (size > threshold)
    missing = (size < threshold) & (ask > 2.0 * threshold)
    area = float(ask.sum())
    share = float(false.mean())
    if area <= 0.0:
        return None, share, None
    return float(size[false].sum()) / area, share, float(ask[missing].sum()) / area
