"""Linear filters of the figures: exact first-order lags and zero-phase bands; numpy only."""

from __future__ import annotations

import itertools

import numpy as np

from motionserver.core.axes import Array


def lag(signal: Array, tau: float, dt: float) -> Array:
    """Pass a signal through 1 / (1 + tau s), exactly for input linear between samples.

    It begins settled at the first sample.

    Args:
        signal: (N,) or (N, M).
        tau: Time constant [s].
        dt: Spacing of the samples [s].

    Returns:
        Filtered signal, same shape.
    """
    decay = float(np.exp(-dt / tau))
    mean = (1.0 - decay) * tau / dt
    drive = (mean - decay) * signal[:-1] + (1.0 - mean) * signal[1:]
    out = np.empty_like(signal, dtype=np.float64)
    out[0] = signal[0]
    for k in range(len(drive)):
        out[k + 1] = decay * out[k] + drive[k]
    return out


def low_pass(signal: Array, corner_hz: float, dt: float) -> Array:
    """Zero-phase low-pass: a Butterworth filter of order two, run forwards and backwards.

    Done on the mirrored signal in the frequency domain, 1 / (1 + (f / corner)^4).

    Args:
        signal: (N, ...).
        corner_hz: Where half the amplitude is left [Hz].
        dt: Spacing of the samples [s].

    Returns:
        What lies below the corner, same shape.
    """
    mirrored = np.concatenate((signal, signal[::-1]))
    frequency = np.fft.rfftfreq(len(mirrored), dt)
    weight = 1.0 / (1.0 + (frequency / corner_hz) ** 4)
    spectrum = np.fft.rfft(mirrored, axis=0)
    spectrum = spectrum * weight.reshape(-1, *(1,) * (signal.ndim - 1))
    kept: Array = np.fft.irfft(spectrum, len(mirrored), axis=0)[: len(signal)]
    return kept


def bands(signal: Array, dt: float, corners_hz: tuple[float, ...]) -> list[Array]:
    """Split a signal at corners [Hz]: from the lowest band to the highest; they add up to it."""
    below = [low_pass(signal, corner, dt) for corner in corners_hz]
    between = [high - low for low, high in itertools.pairwise(below)]
    return [below[0], *between, signal - below[-1]]


def rms(signal: Array) -> float:
    """Root mean square over time of a scalar (N,), or of the length of a vector (N, M)."""
    square = signal**2 if signal.ndim == 1 else np.sum(signal**2, axis=1)
    return float(np.sqrt(np.mean(square)))
