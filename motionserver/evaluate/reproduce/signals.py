"""Accelerations on which the paper's claims are tried."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from motionserver.core.axes import Array, frozen
from motionserver.evaluate.metrics.linear import lag

PERIOD: Final = 0.01
"""Controller's period [s]."""
SEED: Final = 2014


@dataclass(frozen=True, slots=True)
class Signal:
    """A longitudinal acceleration of the vehicle.

    Attributes:
        name: "step", "brake" or "drive".
        what: In words.
        times: (N,) [s].
        wanted: (N,) [m/s2].
    """

    name: str
    what: str
    times: Array
    wanted: Array


def step() -> Signal:
    """A launch: 3.5 m/s2 for 7 s."""
    times = _times(16.0)
    wanted = np.where((times >= 1.0) & (times < 8.0), 3.5, 0.0)
    return Signal("step", "step of 3.5 m/s² for 7 s", times, frozen(wanted))


def brake() -> Signal:
    """An emergency stop of a truck: to -6 m/s2 in 0.3 s, 4 s of it, then the cab swings back."""
    times = _times(16.0)
    wanted = np.interp(times, [1.0, 1.3, 5.0, 5.05], [0.0, -6.0, -6.0, 0.0])
    after = np.maximum(0.0, times - 5.05)
    rebound = 2.0 * np.exp(-1.6 * after) * np.sin(2.0 * np.pi * 0.9 * after)
    return Signal("brake", "truck stop at 6 m/s² with rebound", times, frozen(wanted + rebound))


def drive() -> Signal:
    """Forty seconds of a synthetic town: random levels, smoothed; rms 1.5 m/s2; always the same."""
    times = _times(40.0)
    random = np.random.default_rng(SEED)
    levels, ends, at = [0.0], [1.0], 1.0
    while at < times[-1]:
        at += random.uniform(1.0, 4.0)
        levels.append(float(np.clip(random.normal(0.0, 1.7), -4.0, 3.0)))
        ends.append(at)
    raw = np.array(levels)[np.minimum(np.searchsorted(ends, times, "right"), len(levels) - 1)]
    smooth = lag(lag(raw, 0.15, PERIOD), 0.15, PERIOD)
    wanted = smooth * 1.5 / float(np.sqrt(np.mean(smooth**2)))
    return Signal("drive", "synthetic town, 40 s", times, frozen(wanted))


def _times(duration: float) -> Array:
    return frozen(np.arange(round(duration / PERIOD) + 1) * PERIOD)
