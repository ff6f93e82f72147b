"""What will be wanted over the horizon: the reference model (Thoendel 2014, equation 9, and more).

Six signals: specific force minus g e_z (3), body rates (3).
"""

from __future__ import annotations

from dataclasses import replace
from math import exp
from typing import Final

import numpy as np

from motionserver.core.axes import Array
from motionserver.core.state import Preview, Stimulus
from motionserver.cueing.autoregression import AutoRegression

MODELS: Final = ("constant", "fade", "ar")
HEAVE_FADE: Final = 0.2
"""A vertical acceleration that lasts cannot be followed; believing in it does harm [s]."""
FORCE_FADE: Final = 1.0
"""Time constant of the "fade" model in surge and sway [s]."""
RATE_FADE: Final = 1.0
"""Time constant of body rates [s]."""
PREVIEW_FADE: Final = 1.0
"""How fast the end of a preview passes into the model [s]."""
AR_ORDER: Final = 8
AR_STEP: Final = 0.05
"""Spacing of the samples of the autoregressive model [s]."""
AR_CUTOFF: Final = 2.0 * np.pi * 1.5
"""Low-pass in front of it [rad/s]."""
AR_REST_FADE: Final = 0.2
"""How fast what the low-pass took away fades [s]."""
LARGEST: Final = 8.0
"""Bound of a forecast force [m/s2]."""
LARGEST_FORCE: Final = 50.0
"""More than this is believed of no stimulus [m/s2]."""
LARGEST_RATE: Final = 10.0
"""The same of body rates [rad/s]."""

_FADES: Final = {"constant": np.inf, "fade": FORCE_FADE, "ar": np.inf}


def believable(stimulus: Stimulus) -> Stimulus | None:
    """The stimulus within bounds, a preview with holes left out; None if it is not a number.

    Filters remember: one wild number would be felt for seconds.
    """
    if not (np.isfinite(stimulus.force).all() and np.isfinite(stimulus.rates).all()):
        return None
    preview = stimulus.preview
    if preview is not None:
        tables = (preview.times, preview.force, preview.rates)
        if not all(np.isfinite(table).all() for table in tables):
            preview = None
    return replace(
        stimulus,
        force=np.clip(stimulus.force, -LARGEST_FORCE, LARGEST_FORCE),
        rates=np.clip(stimulus.rates, -LARGEST_RATE, LARGEST_RATE),
        preview=preview,
    )


class Reference:
    """Turns the newest stimulus into six signals at the nodes of the horizon.

    Args:
        model: Model of surge and sway: one of `MODELS`.
        period: Time between two stimuli [s].
        times: Instants after the hand-over that are asked for, (K,) [s].
        lead: From the newest stimulus to the hand-over [s].

    Raises:
        ValueError: The model does not exist.
    """

    def __init__(self, model: str, period: float, times: Array, lead: float) -> None:
        if model not in MODELS:
            raise ValueError(
                f"reference model {model!r} does not exist; allowed: {', '.join(MODELS)}; "
                "change tuning.reference"
            )
        self.model = model
        self._instants = times + lead
        force = _FADES[model]
        scales = np.array([force, force, HEAVE_FADE, RATE_FADE, RATE_FADE, RATE_FADE])
        self._decay = np.exp(-self._instants[:, None] / scales)
        self._stride = max(1, round(AR_STEP / period))
        self._smoothing = 1.0 - exp(-AR_CUTOFF * period)
        self._models = [AutoRegression(AR_ORDER) for _ in range(2)]
        self._history = np.zeros((AR_ORDER * self._stride + 1, 2))
        self._stages = np.zeros((2, 2))
        self._count = 0
        step = self._stride * period
        self._steps = np.arange(int(np.ceil(self._instants[-1] / step)) + 2) * step
        self._rest_decay = np.exp(-self._instants / AR_REST_FADE)[:, None]
        self._forecasts = [m.forecast_matrix(len(self._steps) - 1) for m in self._models]

    def predict(self, stimulus: Stimulus) -> Array:
        """Take in the newest stimulus and look ahead: (K, 6) [m/s2, rad/s]."""
        now = np.concatenate((stimulus.force, stimulus.rates))
        out: Array = now * self._decay
        if self.model == "ar":
            out[:, :2] = self._autoregressive(now[:2])
        if stimulus.preview is not None and len(stimulus.preview.times):
            out = self._with_preview(out, now, stimulus.preview)
        return out

    def _autoregressive(self, now: Array) -> Array:
        if np.isfinite(now).all():
            self._stages[0] += self._smoothing * (now - self._stages[0])
            self._stages[1] += self._smoothing * (self._stages[0] - self._stages[1])
            self._history[1:] = self._history[:-1]
            self._history[0] = self._stages[1]
        self._count += 1
        sampled = self._history[:: self._stride]
        for axis, model in enumerate(self._models):
            # surge and sway learn in different ticks, so that none is much longer than the rest
            if (self._count + axis * (self._stride // 2)) % self._stride == 0:
                model.learn(sampled[1:, axis], float(sampled[0, axis]))
                self._forecasts[axis] = model.forecast_matrix(len(self._steps) - 1)
        out = np.empty((len(self._instants), 2))
        for axis in range(2):
            newest = sampled[:-1, axis]
            ahead = np.concatenate((newest[:1], self._forecasts[axis] @ newest))
            out[:, axis] = np.interp(self._instants, self._steps, ahead)
        rest = (now - self._stages[1]) * self._rest_decay
        forecast: Array = np.clip(out, -LARGEST, LARGEST) + rest
        return forecast

    def _with_preview(self, model: Array, now: Array, preview: Preview) -> Array:
        """Follow the preview while it lasts, then let its last error against the model decay."""
        instants = self._instants
        times = preview.times
        table = np.concatenate((preview.force, preview.rates), axis=1)
        if times[0] > 0.0:
            times, table = np.append(0.0, times), np.concatenate((now[None], table))
        end = float(times[-1])
        known = instants <= end
        out = model.copy()
        for signal in range(6):
            told = np.interp(instants, times, table[:, signal])
            last = np.interp(end, instants, model[:, signal])
            later = (table[-1, signal] - last) * np.exp(-(instants - end) / PREVIEW_FADE)
            out[:, signal] = np.where(known, told, model[:, signal] + later)
        return out
