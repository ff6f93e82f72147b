"""What is searched: which tunables of an algorithm, between which values."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.stats import qmc

from motionserver.core.axes import Array
from motionserver.errors import ConfigError
from motionserver.settings.fields import bounds
from motionserver.settings.tuning import TuningModel

DIGITS: Final = 4
"""Significant digits of a tried value, so that the preset holds exactly what was driven."""
NEAR: Final = 0.15
"""Half width of the neighbourhood searched by a refinement, as a share of each range."""
Value = float | str
Values = Mapping[str, Value]


@dataclass(frozen=True, slots=True)
class Parameter:
    """One searched tunable.

    Attributes:
        name: As in `TuningModel`.
        low: Least value; 0 for a word.
        high: Largest value; 0 for a word.
        logarithmic: Whether ratios count rather than differences.
        choices: Words to choose from; empty for a number.
    """

    name: str
    low: float = 0.0
    high: float = 0.0
    logarithmic: bool = True
    choices: tuple[str, ...] = ()

    def at(self, share: float) -> Value:
        """The value at ``share`` of the range, 0..1."""
        if self.choices:
            return self.choices[min(int(share * len(self.choices)), len(self.choices) - 1)]
        if self.logarithmic:
            value = self.low * (self.high / self.low) ** share
        else:
            value = self.low + (self.high - self.low) * share
        return float(f"{value:.{DIGITS}g}")

    def share(self, value: Value) -> float:
        """Where in the range a value lies, 0..1; the middle of its part for a word."""
        if self.choices:
            return (self.choices.index(str(value)) + 0.5) / len(self.choices)
        number = float(value)
        if self.logarithmic:
            return float(np.log(number / self.low) / np.log(self.high / self.low))
        return (number - self.low) / (self.high - self.low)

    def at_bound(self, value: Value) -> bool:
        """Whether a number lies in the outermost twentieth of its range."""
        return not self.choices and not 0.05 <= self.share(value) <= 0.95


def _around(name: str, factor: float) -> Parameter:
    """``factor`` to both sides of the default, within what the tunable may be."""
    item = TuningModel.model_fields[name]
    low, high, _ = bounds(item, None)
    return Parameter(name, max(low, item.default / factor), min(high, item.default * factor))


SCALE: Final = Parameter("scale", 0.3, 1.0, logarithmic=False)
"""Searched only on demand, see `space_of`."""
SPACES: Final[dict[str, tuple[Parameter, ...]]] = {
    "mpc": (
        _around("mpc_weight_position", 10.0),
        _around("mpc_weight_attitude", 10.0),
        _around("mpc_weight_rates", 10.0),
        _around("mpc_weight_heave", 5.0),
        _around("mpc_weight_tilt_rate", 5.0),
        _around("mpc_trust_s", 3.0),
        # "vehicle" needs pedals and steering, which few recordings hold; a predictor for "learned"
        # may have been fitted to the very recording that is held out
        Parameter("reference", choices=("constant", "fade", "ar")),
    ),
    "thondel2014": (
        _around("weight_input", 10.0),
        _around("weight_position", 10.0),
        _around("weight_change", 10.0),
    ),
    "classical": (Parameter("gain", 0.05, 1.0, logarithmic=False),),
}
"""Searched tunables by algorithm."""


def space_of(algorithm: str, search_scale: bool = False) -> tuple[Parameter, ...]:
    """The searched tunables of an algorithm.

    Args:
        algorithm: Its name.
        search_scale: Whether the scale the algorithm is asked for is searched as well. What is
            wanted stays at the fixed scale, else scale 0 would win: nothing wanted, nothing wrong.

    Raises:
        ConfigError: Nothing is known to search.
    """
    if algorithm not in SPACES:
        raise ConfigError(
            "--algorithm",
            f"nothing is known to tune of {algorithm!r}",
            f"Allowed: {', '.join(SPACES)}.",
        )
    return SPACES[algorithm] + ((SCALE,) if search_scale else ())


def pool(space: Sequence[Parameter], count: int, seed: int) -> list[dict[str, Value]]:
    """``count`` points spread evenly over the space: a scrambled Sobol' sequence.

    It depends on nothing but its arguments, and a larger count continues a smaller one.
    """
    return [_point(space, row) for row in _sobol(len(space), count, seed)]


def near(
    space: Sequence[Parameter], centre: Values, count: int, seed: int
) -> list[dict[str, Value]]:
    """``count`` points around a centre; words stay as they are there.

    The same centre gives the same points, whoever asks: folds that agree share the work.
    """
    text = ";".join(f"{p.name}={centre[p.name]!r}" for p in space)
    salt = int.from_bytes(hashlib.sha256(f"{seed};{text}".encode()).digest()[:4], "big")
    here = np.array([p.share(centre[p.name]) for p in space])
    points = []
    for row in _sobol(len(space), count, salt):
        shares = np.clip(here + NEAR * (2.0 * row - 1.0), 0.0, 1.0)
        point = _point(space, shares)
        points.append(point | {p.name: centre[p.name] for p in space if p.choices})
    return points


def _point(space: Sequence[Parameter], shares: Array) -> dict[str, Value]:
    return {p.name: p.at(float(share)) for p, share in zip(space, shares, strict=True)}


def _sobol(dimensions: int, count: int, seed: int) -> Array:
    """The first points of the sequence; whole powers of two are drawn, as it wants."""
    if count <= 0:
        return np.empty((0, dimensions))
    sequence = qmc.Sobol(dimensions, scramble=True, rng=np.random.default_rng(seed))
    drawn: Array = sequence.random_base2(int(count - 1).bit_length())
    return drawn[:count]
