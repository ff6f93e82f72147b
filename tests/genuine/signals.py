"""Filters, resampling and least squares on uniformly sampled signals."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_lsq_spline
from scipy.signal import butter, sosfiltfilt

Array = NDArray[np.float64]

RATE: Final = 100.0
"""Of the project's recordings [Hz]."""
PROOF_BAND: Final = 0.5
"""Physics is compared below this [Hz]: above it speed is measured too coarsely to differentiate."""


def lowpass(x: Array, cut: float, rate: float = RATE) -> Array:
    """Second-order Butterworth, forward and backward: no phase."""
    filtered: Array = sosfiltfilt(butter(2, cut, fs=rate, output="sos"), x, axis=0)
    return filtered


def derivative(x: Array, rate: float = RATE) -> Array:
    """Central differences per second."""
    slope: Array = np.gradient(x, 1.0 / rate, axis=0)
    return slope


def uniform(t: Array, values: Array, times: Array) -> Array:
    """Values at `times` without content above the source's own Nyquist frequency.

    Slower sources: linear interpolation, then a low-pass at 0.4 of the source rate, which takes
    out the images of the straight lines. Faster sources: low-pass at 40 Hz first.

    Raises:
        ValueError: Times do not increase.
    """
    if not np.all(np.diff(t) > 0.0):
        raise ValueError("source times do not increase")
    rate = 1.0 / float(np.median(np.diff(t)))
    if rate > 1.02 * RATE:
        even = np.arange(t[0], t[-1], 1.0 / rate)
        values = lowpass(_linear(even, t, values), 40.0, rate)
        t = even
    out = _linear(times, t, values)
    return out if rate > 0.98 * RATE else lowpass(out, 0.4 * rate)


def _linear(times: Array, t: Array, values: Array) -> Array:
    if values.ndim == 1:
        return np.interp(times, t, values)
    return np.column_stack([np.interp(times, t, column) for column in values.T])


def correlation(measured: Array, expected: Array) -> tuple[float, float]:
    """Correlation, and gain of `measured` over `expected` by least squares with an offset."""
    m, e = measured - measured.mean(), expected - expected.mean()
    scale = float(np.sqrt((m @ m) * (e @ e)))
    return (float(m @ e) / scale, float(m @ e) / float(e @ e)) if scale > 0.0 else (0.0, 0.0)


def still(v: Array, seconds: float = 3.0, below: float = 0.15) -> NDArray[np.bool_]:
    """Samples within stretches of at least `seconds` that stand still, less 1 s at either end.

    Rolling out and setting off are below a speed that can be told from zero, and no standstill.
    """
    slow = np.concatenate([[False], v < below, [False]])
    edges = np.flatnonzero(np.diff(slow.astype(int)))
    out = np.zeros(len(v), dtype=bool)
    for start, end in zip(edges[::2], edges[1::2], strict=True):
        if end - start >= seconds * RATE:
            out[start + round(RATE) : end - round(RATE)] = True
    return out


def slow_part(x: Array, knots_every: float) -> Array:
    """Cubic spline by least squares with a knot each `knots_every` seconds.

    Unlike a filter it has no edges to settle at.
    """
    t = np.arange(len(x)) / RATE
    inner = np.linspace(t[0], t[-1], max(2, round(t[-1] / knots_every) + 1))[1:-1]
    knots = np.concatenate([[t[0]] * 4, inner, [t[-1]] * 4])
    fitted: Array = make_lsq_spline(t, x, knots, k=3)(t)
    return fitted


def integral(x: Array) -> Array:
    """Trapezoidal, from zero."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (x[1:] + x[:-1]))]) / RATE
