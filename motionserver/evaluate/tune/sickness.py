"""How much of the felt motion lies where motion makes people sick: the weighting W_f.

ISO 2631-1:1997, section 9 and Annex A: motion sickness follows acceleration between about 0.08 and
0.63 Hz, most at 0.16-0.2 Hz, weighted by W_f; the dose over a time T is MSDV = a_w sqrt(T), and
about MSDV / 3 per cent of unadapted adults vomit. The standard defines it for vertical motion. In a
driving simulator most of what is felt is horizontal; on coaches illness followed lateral motion
below 0.5 Hz (Turner and Griffin 1999, Ergonomics 42, 1646-1664), and sinusoids along the three axes
were found about equally sickening, worst around 0.2 Hz. So all three axes count alike here: an
approximation, meant to compare tunings, not to foretell who will be ill.
"""

from __future__ import annotations

from math import pi, sqrt
from typing import Any, Final

import numpy as np

from motionserver.core.axes import Array

Complex = np.ndarray[Any, np.dtype[np.complex128]]

BAND_HZ: Final = (0.08, 0.63)
"""Corners f1, f2 of the band, Butterworth of order two (ISO 2631-1 Annex A; ISO 8041)."""
TRANSITION: Final = (0.25, 0.86)
"""f4 [Hz] and Q4 of the low-pass; f3 is infinite."""
STEP: Final = ((0.0625, 0.80), (0.1, 0.80))
"""f5 [Hz], Q5 and f6 [Hz], Q6 of the upward step."""
_SETTLED: Final = 60.0
"""Silence appended so that the end does not fold back onto the beginning [s]."""


def weighting(frequency_hz: np.ndarray) -> Complex:
    """Response of W_f at ``frequency_hz`` (N,), complex (N,)."""
    s: Complex = np.asarray(2j * pi * frequency_hz, dtype=np.complex128)
    (f5, q5), (f6, q6) = STEP
    response: Complex = (
        s**2
        / _second(s, BAND_HZ[0], 1.0 / sqrt(2.0))
        * (2.0 * pi * BAND_HZ[1]) ** 2
        / _second(s, BAND_HZ[1], 1.0 / sqrt(2.0))
        * (2.0 * pi * TRANSITION[0]) ** 2
        / _second(s, *TRANSITION)
        * _second(s, f5, q5)
        / _second(s, f6, q6)
    )
    return response


def weighted_rms(force: Array, dt: float) -> float:
    """W_f-weighted rms of a felt force (N, 3), all axes together [m/s2].

    The signal begins settled at its first sample: an offset that was always there sickens nobody.
    """
    moving = force - force[0]
    count = len(moving)
    whole = count + round(_SETTLED / dt)
    spectrum = np.fft.rfft(moving, whole, axis=0)
    spectrum *= weighting(np.fft.rfftfreq(whole, dt))[:, None]
    weighted = np.fft.irfft(spectrum, whole, axis=0)[:count]
    return float(np.sqrt(np.mean(np.sum(weighted**2, axis=1))))


def _second(s: Complex, corner_hz: float, quality: float) -> Complex:
    omega = 2.0 * pi * corner_hz
    value: Complex = s**2 + s * omega / quality + omega**2
    return value
