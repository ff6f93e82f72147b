"""What canals and otoliths make of a motion: the perceived error.

Transfer functions of Telban and Cardullo, see `motionserver.cueing.perception`.
"""

from __future__ import annotations

import numpy as np

from motionserver.core.axes import Array
from motionserver.cueing.perception import TELBAN_CARDULLO, Organ
from motionserver.evaluate.metrics.linear import lag


def sensed(organ: Organ, signal: Array, dt: float) -> Array:
    """Pass a signal (N, ...) through an organ, ``dt`` [s] between samples."""
    out = organ.direct * signal
    for share, tau in zip(organ.shares, organ.taus, strict=True):
        out = out + share * lag(signal, tau, dt)
    return out


def perceived(force: Array, rates: Array, dt: float) -> Array:
    """Sensed specific force and rates, (N, 6), of motion (N, 3) and (N, 3)."""
    senses = TELBAN_CARDULLO
    return np.column_stack((sensed(senses.force, force, dt), sensed(senses.roll, rates, dt)))
