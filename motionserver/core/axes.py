"""Axes, their order and gravity: ISO 8855, x forward, y left, z up, pitch positive nose down."""

from __future__ import annotations

from enum import IntEnum
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

GRAVITY: Final = 9.81
"""Standard gravity of every formula here [m/s2]."""


class Axis(IntEnum):
    """The six pose coordinates in the order used everywhere."""

    SURGE = 0
    SWAY = 1
    HEAVE = 2
    ROLL = 3
    PITCH = 4
    YAW = 5


AXIS_NAMES: Final = tuple(axis.name.lower() for axis in Axis)


def frozen(values: object) -> Array:
    """Return ``values`` as a read-only float64 array, so that shared state cannot be edited."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array
