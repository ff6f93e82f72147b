"""What the simulator said would come: kept while it is fresh, left gently when it is not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from motionserver.core.axes import Array
from motionserver.core.state import Preview, Stimulus

FRESH: Final = 0.3
"""A preview this old still counts in full; previews may come more seldom than packets [s]."""
FADE: Final = 0.5
"""Time in which an old preview's weight goes to zero, and a new one's to one [s]."""
END_FADE: Final = 1.0
"""How fast the end of a preview passes into the model [s]."""
JOIN: Final = 0.1
"""How fast the difference between the preview's present and the real one is forgotten [s]."""
NO_SHARE: Final = 1e-6
"""A preview scaled by less holds nothing [-]."""


@dataclass(frozen=True, slots=True)
class _Kept:
    times: Array
    table: Array
    share: float


class PreviewKeeper:
    """Blends the last preview, aged by the periods since it came, into a model's forecast.

    A preview is new if its table of times is another object than that of the period before:
    intake gives the same packet to several periods, and sends its preview along each time.

    Args:
        period: Time between two calls [s].
        instants: Instants of the forecast, (K,) [s].

    Attributes:
        weight: How far the forecast follows the preview, 0..1 [-].
    """

    def __init__(self, period: float, instants: Array) -> None:
        self.weight = 0.0
        self._period, self._instants = period, np.append(0.0, instants)
        self._join = np.exp(-instants / JOIN)[:, None]
        self._seen: Array | None = None
        self._kept: _Kept | None = None
        self._age = 0.0
        self._asked = False

    def blend(self, model: Array, stimulus: Stimulus) -> Array:
        """Follow the preview while it lasts, then let its last error against the model decay.

        Args:
            model: What is expected without preview, (K, 6).
            stimulus: Of this period; with or without preview.

        Returns:
            Forecast, (K, 6).
        """
        self._age += self._period
        preview = stimulus.preview
        if stimulus.gain <= 0.0:
            # nothing is wanted; what was told before belongs to another drive
            self._kept = None
        elif preview is not None and preview.times is not self._seen and len(preview.times):
            self._keep(preview, stimulus)
        step = self._period / FADE
        goal = self._goal()
        # a drive that begins with a preview has nothing to fade from
        self.weight = goal if not self._asked else _towards(self.weight, goal, step)
        self._asked = True
        kept = self._kept
        if kept is None or self.weight <= 0.0:
            return model
        told = self._told(kept, model, stimulus)
        return model + self.weight * (told - model)

    @property
    def end(self) -> float:
        """How far from now the last preview goes [s]; below 0 if used up or never told."""
        return -1.0 if self._kept is None else float(self._kept.times[-1]) - self._age

    def _goal(self) -> float:
        if self._kept is None:
            return 0.0
        return float(np.clip(1.0 - (self._age - FRESH) / FADE, 0.0, 1.0))

    def _keep(self, preview: Preview, stimulus: Stimulus) -> None:
        self._seen = preview.times
        times = preview.times
        table = np.concatenate((preview.force, preview.rates), axis=1)
        if times[0] > 0.0:
            now = np.concatenate((stimulus.force, stimulus.rates))
            times, table = np.append(0.0, times), np.concatenate((now[None], table))
        self._kept, self._age = _Kept(times, table, stimulus.share), 0.0

    def _told(self, kept: _Kept, model: Array, stimulus: Stimulus) -> Array:
        # the cue may have been faded or scaled otherwise since
        factor = stimulus.share / kept.share if kept.share > NO_SHARE else 0.0
        table = kept.table * factor
        now = np.concatenate((stimulus.force, stimulus.rates))
        instants = self._instants
        end = self.end
        beyond = np.exp(-np.maximum(instants - end, 0.0) / END_FADE)
        base = np.concatenate((now[None], model))
        last = _line(np.array([end]), instants, base)
        later = base + (table[-1] - last) * beyond[:, None]
        line = _line(instants + self._age, kept.times, table)
        told = np.where((instants <= end)[:, None], line, later)
        out: Array = told[1:] + (now - told[0]) * self._join
        return out


def _towards(value: float, goal: float, step: float) -> float:
    return min(max(goal, value - step), value + step)


def _line(at: Array, times: Array, table: Array) -> Array:
    """Linear between the rows of a table (n, S), constant beyond, (len(at), S)."""
    if len(times) < 2:
        return np.repeat(table, len(at), axis=0)
    left = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    begin = times[left]
    share = np.clip((at - begin) / (times[left + 1] - begin), 0.0, 1.0)[:, None]
    out: Array = table[left] + share * (table[left + 1] - table[left])
    return out
