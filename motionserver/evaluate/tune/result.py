"""What a search found: trials, figures, the choice, and the choice of every fold."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from motionserver.core.limits import Machine
from motionserver.cueing.tuning import Tuning
from motionserver.evaluate.tune.criterion import Criterion, objection
from motionserver.evaluate.tune.outcome import Outcome
from motionserver.evaluate.tune.space import Parameter, Value
from motionserver.evaluate.tune.stretches import Stretch
from motionserver.settings.tuning import TuningModel, apply_changes

NOTICEABLE: Final = 0.01
"""Least gain over the defaults that is called one."""


@dataclass(frozen=True, slots=True)
class Settings:
    """Everything that decides what a search finds.

    Attributes:
        algorithm: What is tuned.
        criterion: What is better.
        trials: Default and pool together.
        refine: Further trials around the best, for every fold; 0 for none.
        seed: Of the pool.
        excerpt: Length of the judged stretch of every recording; 0 for all of it [s].
        planner_hz: Planner rate [Hz].
        base: All tunables that are not searched, and the defaults of those that are.
        space: What is searched.
    """

    algorithm: str
    criterion: Criterion
    trials: int
    refine: int
    seed: int
    excerpt: float
    planner_hz: float
    base: TuningModel
    space: tuple[Parameter, ...]


@dataclass(frozen=True, slots=True)
class Trial:
    """One set of values.

    Attributes:
        number: From 0, the defaults.
        origin: "default", "pool", or "near N" for a refinement around trial N.
        values: Searched tunables by name.
        model: All tunables.
        outcomes: By recording.
    """

    number: int
    origin: str
    values: dict[str, Value]
    model: TuningModel
    outcomes: dict[str, Outcome]


@dataclass(frozen=True, slots=True)
class Fold:
    """A choice made without one recording.

    Attributes:
        held_out: Name of the recording nobody looked at; empty for the choice on all of them.
        trial: What was chosen.
        score: Its mean score over the recordings that were looked at.
        candidates: Trials in the running.
    """

    held_out: str
    trial: Trial
    score: float
    candidates: int


@dataclass(frozen=True, slots=True)
class TuneResult:
    """A finished search.

    Attributes:
        settings: What was asked for.
        machine: The platform, head included.
        stretches: What was driven, in the order given.
        trials: All, by number.
        final: The choice on all recordings: what the preset holds.
        folds: The choices without each recording, in the order of the stretches.
        command: How to do it again.
    """

    settings: Settings
    machine: Machine
    stretches: tuple[Stretch, ...]
    trials: tuple[Trial, ...]
    final: Fold
    folds: tuple[Fold, ...]
    command: str

    @property
    def tuning(self) -> Tuning:
        """The chosen tuning, SI."""
        return self.final.trial.model.to_tuning()

    @property
    def fold_tunings(self) -> dict[str, Tuning]:
        """For each recording the tuning that was chosen without it."""
        return {fold.held_out: fold.trial.model.to_tuning() for fold in self.folds}

    @property
    def default(self) -> Trial:
        """The trial with the defaults."""
        return self.trials[0]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the recordings."""
        return tuple(stretch.name for stretch in self.stretches)

    def score(self, trial: Trial, names: Iterable[str] | None = None) -> float:
        """Mean score of a trial over recordings; all of them if None."""
        chosen = self.names if names is None else tuple(names)
        return self.settings.criterion.mean([trial.outcomes[name] for name in chosen])

    @property
    def held_out_score(self) -> float:
        """Mean over the recordings of the score that the choice made without it reaches on it."""
        criterion = self.settings.criterion
        return criterion.mean([fold.trial.outcomes[fold.held_out] for fold in self.folds])

    @property
    def pays(self) -> bool:
        """Whether choosing like this beats the defaults, noticeably, on drives it has not seen."""
        return self.held_out_score < (1.0 - NOTICEABLE) * self.score(self.default)

    @property
    def held_out_violations(self) -> int:
        """Samples beyond a limit, or rejected plans, of fold choices on what they had not seen."""
        seen = [fold.trial.outcomes[fold.held_out] for fold in self.folds]
        return sum(outcome.violations + outcome.rejected for outcome in seen)

    def objection(self, trial: Trial) -> str:
        """Why a trial is out of the running on all recordings it was driven on."""
        tilt = self.settings.base.to_tuning().tilt_rate
        return objection(trial.outcomes, self.default.outcomes, tilt)


def model_of(base: TuningModel, values: dict[str, Value]) -> TuningModel:
    """The base with some values changed, checked like a request of the page.

    Raises:
        TuningError: A value is not allowed.
    """
    return apply_changes(base, dict(values))
