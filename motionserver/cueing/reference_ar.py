"""Surge and sway as autoregressive models of their own slow part, learnt as they come."""

from __future__ import annotations

from math import exp
from typing import Final

import numpy as np

from motionserver.core.axes import Array
from motionserver.core.state import Stimulus
from motionserver.cueing.autoregression import AutoRegression
from motionserver.cueing.reference_base import Decay
from motionserver.cueing.standstill import Standstill

AR_ORDER: Final = 8
AR_STEP: Final = 0.05
"""Spacing of the samples of the autoregressive model [s]."""
AR_CUTOFF: Final = 2.0 * np.pi * 1.5
"""Low-pass in front of it, two equal poles [rad/s]."""
AR_REST_FADE: Final = 0.2
"""How fast what the low-pass took away fades [s]."""
LARGEST: Final = 8.0
"""Bound of a forecast force [m/s2]."""
BACK: Final = 0.5
"""Share of what was seen on one side that is believed of the other."""
SEEN_FADE: Final = 4.0
"""How long what was seen counts as what can be [s]."""
BEYOND: Final = 1.1
"""A forecast reaches at most so many times as far as anything seen: at the onset of braking the
model would run on along the ramp, and platform and force would go the wrong way to make room."""


class LowPassed:
    """Several signals behind two equal poles, with their past at regular spacing.

    Args:
        period: Time between two calls [s].
        signals: How many signals, S.

    Attributes:
        stride: Calls between two samples of the past.
    """

    def __init__(self, period: float, signals: int) -> None:
        self.stride = max(1, round(AR_STEP / period))
        self._smoothing = 1.0 - exp(-AR_CUTOFF * period)
        self._stages = np.zeros((2, signals))
        self._history = np.zeros((AR_ORDER * self.stride + 1, signals))

    @property
    def slow(self) -> Array:
        """Low-passed now, (S,)."""
        newest: Array = self._stages[1]
        return newest

    @property
    def past(self) -> Array:
        """Now and samples before it `AR_STEP` apart, newest first, (order + 1, S)."""
        sampled: Array = self._history[:: self.stride]
        return sampled

    def take(self, now: Array) -> None:
        """Take in the signals (S,); what is no number is left out."""
        if not np.isfinite(now).all():
            return
        self._stages[0] += self._smoothing * (now - self._stages[0])
        self._stages[1] += self._smoothing * (self._stages[0] - self._stages[1])
        self._history[1:] = self._history[:-1]
        self._history[0] = self._stages[1]


class SlowSignals:
    """Several signals, each forecast by a model of its own.

    Args:
        period: Time between two calls [s].
        instants: Instants that are asked for, (K,) [s].
        signals: How many signals, S.
        bound: Bound of what the models forecast, in the signals' unit.
    """

    def __init__(
        self, period: float, instants: Array, signals: int, bound: float = LARGEST
    ) -> None:
        self._bound = bound
        self._seen = np.zeros((2, signals))
        self._forget = exp(-period / SEEN_FADE)
        self.passed = LowPassed(period, signals)
        self._stride = self.passed.stride
        self._models = [AutoRegression(AR_ORDER) for _ in range(signals)]
        self._count = 0
        step = self._stride * period
        steps = np.arange(int(np.ceil(instants[-1] / step)) + 2) * step
        # row: weights of the forecast's steps at one instant, linear between them
        self._between: Array = np.column_stack(
            [np.interp(instants, steps, unit) for unit in np.eye(len(steps))]
        )
        self._rest_decay = np.exp(-instants / AR_REST_FADE)[:, None]
        self._maps: Array = np.stack([self._map(model) for model in self._models])

    def _map(self, model: AutoRegression) -> Array:
        """From the samples of the past to the instants, (K, order)."""
        steps = self._between.shape[1]
        rows = np.concatenate((np.eye(1, AR_ORDER), model.forecast_matrix(steps - 1)))
        out: Array = self._between @ rows
        return out

    def predict(self, now: Array) -> Array:
        """Take in the signals (S,) and look ahead: (K, S). Ignores what is no number."""
        self.passed.take(now)
        self._count += 1
        sampled = self.passed.past
        signals = len(self._models)
        for signal, model in enumerate(self._models):
            # signals learn in different ticks, so that none is much longer than the rest
            if (self._count + signal * self._stride // signals) % self._stride == 0:
                model.learn(sampled[1:, signal], float(sampled[0, signal]))
                self._maps[signal] = self._map(model)
        ahead = (self._maps @ sampled[:-1].T[:, :, None])[:, :, 0].T
        rest = (now - self.passed.slow) * self._rest_decay
        if np.isfinite(now).all():
            both = np.stack((-now, now))
            self._seen = np.maximum(self._forget * self._seen, both)
        # what swings one way may swing back, though not as far as long as it has not
        reach = BEYOND * np.maximum(self._seen, BACK * self._seen[::-1])
        low, high = np.minimum(reach, self._bound)
        forecast: Array = np.clip(ahead, -low, high) + rest
        return forecast


class Autoregressive:
    """The model "ar": surge and sway autoregressive, and a braking vehicle ends at standstill."""

    def __init__(self, period: float, instants: Array) -> None:
        self.status = "ar"
        self._decay = Decay(instants)
        self._slow = SlowSignals(period, instants, 2)
        self._standstill = Standstill(instants)

    def predict(self, stimulus: Stimulus, turning: Array) -> Array:
        """Look ahead; see `AxisModel.predict`."""
        out = self._decay.of(stimulus)
        out[:, :2] = self._slow.predict(stimulus.force[:2])
        self._standstill.end(out[:, 0], stimulus)
        return out
