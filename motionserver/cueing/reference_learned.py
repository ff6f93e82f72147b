"""Surge and sway from recorded drives: the autoregressive forecast, corrected by a fitted map.

The map is linear in the scaled signals, with coefficients that may depend on speed, and has no
constant: a drive shown at half the scale is forecast at half the scale, and left mirrors right.
Fitted alone, such a map carries over badly from one driver to another; as a correction, shrunk
towards none, it can only take what holds on the drives it did not see.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from motionserver.core.axes import Array
from motionserver.core.state import Stimulus
from motionserver.cueing.predictor import FEATURES, Predictor, check
from motionserver.cueing.reference_ar import LARGEST, LowPassed, SlowSignals
from motionserver.cueing.reference_base import Decay
from motionserver.cueing.standstill import Standstill

SPEED_UNIT: Final = 10.0
FASTEST: Final = 60.0
"""Speed beyond which the map is not asked [m/s]."""
SPARSE: Final = 2
"""Rates are taken at every second sample of the past."""


class Features:
    """What the map sees, kept up to date period by period.

    A row holds, for surge or sway: the base forecast at that horizon (1), the force now (1), its
    slow part at 8 samples of the past, the body rate that goes with it at 4, the same times speed
    at 4, the slow part times speed at 4; F = 22.

    Args:
        period: Time between two calls [s].
        instants: Instants of the base forecast, (K,) [s].
    """

    def __init__(self, period: float, instants: Array) -> None:
        self._slow = SlowSignals(period, instants, 2, LARGEST)
        self._rates = LowPassed(period, 2)
        self._standstill = Standstill(instants)

    def take(self, stimulus: Stimulus, turning: Array) -> Array:
        """Take in a stimulus and rates; the base forecast of surge and sway, (K, 2)."""
        base = self._slow.predict(stimulus.force[:2])
        self._standstill.end(base[:, 0], stimulus)
        self._rates.take(turning[1:])
        return base

    def row(self, axis: int, stimulus: Stimulus) -> Array:
        """Features of surge (0) or sway (1) but for the first, the base: (F - 1,)."""
        past = self._slow.passed.past[:-1, axis]
        turn = self._rates.past[:-1:SPARSE, axis]
        speed = min(max(stimulus.speed, -FASTEST), FASTEST) / SPEED_UNIT
        return np.concatenate(
            ([stimulus.force[axis]], past, turn, speed * turn, speed * past[::SPARSE])
        )


class Learned:
    """The model "learned".

    Raises:
        PredictorError: The predictor's matrices do not fit.
    """

    def __init__(self, period: float, instants: Array, predictor: Predictor) -> None:
        check(predictor, f"predictor {predictor.name}")
        self.status = f"learned: {predictor.name}"
        self._decay = Decay(instants)
        self._features = Features(period, instants)
        self._standstill = Standstill(instants)
        # the map at the instants asked for: none now, then linear between its horizons
        horizons = np.append(0.0, predictor.horizons)
        known = np.concatenate((np.zeros((2, 1, FEATURES)), predictor.weights), axis=1)
        self._weights = np.empty((2, len(instants), FEATURES))
        for axis in range(2):
            for feature in range(FEATURES):
                column = known[axis, :, feature]
                self._weights[axis, :, feature] = np.interp(instants, horizons, column)

    def predict(self, stimulus: Stimulus, turning: Array) -> Array:
        """Look ahead; see `AxisModel.predict`."""
        out = self._decay.of(stimulus)
        base = self._features.take(stimulus, turning)
        for axis in range(2):
            weights = self._weights[axis]
            ahead = base[:, axis] * (1.0 + weights[:, 0])
            ahead += weights[:, 1:] @ self._features.row(axis, stimulus)
            out[:, axis] = np.clip(ahead, -2.0 * LARGEST, 2.0 * LARGEST)
        self._standstill.end(out[:, 0], stimulus)
        return out
