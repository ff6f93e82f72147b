"""Autoregressive model of a signal, learnt as it comes by recursive least squares."""

from __future__ import annotations

import numpy as np

from motionserver.core.axes import Array

FORGETTING = 0.99
LARGEST_TRACE = 1e4


class AutoRegression:
    """y_k = w . (y_k-1 ... y_k-p) for one signal; science note: e, K, w, P of standard RLS.

    Starts as "tomorrow is as today", w = (1, 0, ...). The trace of P is capped, since it winds
    up while a vehicle stands still.
    """

    def __init__(self, order: int, forgetting: float = FORGETTING) -> None:
        self.order = order
        self._forgetting = forgetting
        self.weights: Array = np.zeros(order)
        self.weights[0] = 1.0
        self.covariance: Array = 10.0 * np.eye(order)

    def learn(self, past: Array, value: float) -> None:
        """Take in ``value`` that followed ``past`` (p,), newest first. Ignores non-numbers."""
        if not (np.isfinite(value) and np.isfinite(past).all()):
            return
        gain = self.covariance @ past
        gain = gain / (self._forgetting + past @ gain)
        self.weights = self.weights + gain * (value - self.weights @ past)
        shrunk = self.covariance - np.outer(gain, past @ self.covariance)
        covariance = (shrunk + shrunk.T) / (2.0 * self._forgetting)
        trace = float(np.trace(covariance))
        self.covariance = covariance * min(1.0, LARGEST_TRACE / trace)

    def stable_weights(self) -> Array:
        """The weights with every root pulled inside the unit circle: w_i / rho^i."""
        companion = np.eye(self.order, k=-1)
        companion[0] = self.weights
        radius = float(np.max(np.abs(np.linalg.eigvals(companion))))
        if radius <= 1.0:
            return self.weights
        shrunk: Array = self.weights / radius ** np.arange(1, self.order + 1)
        return shrunk

    def forecast_matrix(self, steps: int) -> Array:
        """Map from the past (p,), newest first, to the next ``steps`` values: (steps, p)."""
        companion = np.eye(self.order, k=-1)
        companion[0] = self.stable_weights()
        # first rows of its powers; every round doubles how many are known
        rows, power = companion[:1], companion
        while len(rows) < steps:
            rows = np.concatenate((rows, rows @ power))
            power = power @ power
        return rows[:steps]
