"""How much each tunable matters, read from the trials that were driven anyway."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np
from scipy.stats import rankdata

from motionserver.evaluate.tune.result import Trial, TuneResult
from motionserver.evaluate.tune.space import Parameter


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """One tunable over the pool.

    Attributes:
        parameter: Which.
        correlation: Rank correlation of value and mean score; negative = more is better; None for
            a word, or where nothing varies.
        levels: Thirds of the range, or the words, each with the mean score of the trials in it;
            None where there is none.
    """

    parameter: Parameter
    correlation: float | None
    levels: tuple[tuple[str, float | None], ...]

    @property
    def spread(self) -> float:
        """Best to worst level: what the tunable moves on the whole."""
        known = [score for _, score in self.levels if score is not None]
        return max(known) - min(known) if known else 0.0


def noise(count: int) -> float:
    """Rank correlation that chance alone exceeds in one case of twenty, for so many trials."""
    return 1.96 / sqrt(max(count - 1, 1))


def pool_of(result: TuneResult) -> list[Trial]:
    """The trials spread evenly over the space, whether or not they are in the running."""
    return [trial for trial in result.trials if trial.origin == "pool"]


def sensitivities(result: TuneResult) -> list[Sensitivity]:
    """One for each searched tunable."""
    trials = pool_of(result)
    scores = np.array([result.score(trial) for trial in trials])
    return [_of(parameter, trials, scores) for parameter in result.settings.space]


def _of(parameter: Parameter, trials: Sequence[Trial], scores: np.ndarray) -> Sensitivity:
    shares = np.array([parameter.share(trial.values[parameter.name]) for trial in trials])
    if parameter.choices:
        labels = list(parameter.choices)
        groups = [
            np.array([trial.values[parameter.name] == word for trial in trials], dtype=bool)
            for word in labels
        ]
        return Sensitivity(parameter, None, _levels(labels, groups, scores))
    edges = [parameter.at(k / 3.0) for k in range(4)]
    labels = [f"{a:.3g}..{b:.3g}" for a, b in itertools.pairwise(edges)]
    part = np.minimum((3.0 * shares).astype(int), 2)
    groups = [part == k for k in range(3)]
    return Sensitivity(parameter, _correlation(shares, scores), _levels(labels, groups, scores))


def _levels(
    labels: list[str], groups: list[np.ndarray], scores: np.ndarray
) -> tuple[tuple[str, float | None], ...]:
    return tuple(
        (label, float(scores[group].mean()) if group.any() else None)
        for label, group in zip(labels, groups, strict=True)
    )


def _correlation(values: np.ndarray, scores: np.ndarray) -> float | None:
    """Spearman's: Pearson's of the ranks."""
    if len(values) < 3 or np.ptp(values) == 0.0 or np.ptp(scores) == 0.0:
        return None
    return float(np.corrcoef(rankdata(values), rankdata(scores))[0, 1])
