"""Leave-one-out search: one pool that has seen nothing, and a choice per fold.

Choosing on the recordings one reports flatters; so each recording is also judged with the values
chosen on all the others. That costs little here: every trial is driven on every recording once,
and each fold only looks at other columns of the same table.

It is exact because the pool is a quasi-random sequence that knows no recording. A sampler that
learns from the scores would have seen the held-out recording through the trials it proposed, unless
each fold had a study of its own and drove its own trials: as many times the work as there are
recordings, and tens of trials in six tunables are few to learn from. The second phase does learn,
and so it is one per fold: trials near the fold's best, which depend on the other recordings only.
Folds that agree about the best share their trials.

The sequence is drawn by scipy, which the server has anyway; a framework for learning samplers comes
with a database and half a dozen packages, for what a file of lines does here.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from motionserver.core.limits import Machine
from motionserver.errors import ConfigError
from motionserver.evaluate.tune.cache import ResultCache
from motionserver.evaluate.tune.criterion import objection
from motionserver.evaluate.tune.driving import Progress, drive_all
from motionserver.evaluate.tune.outcome import Job, Outcome
from motionserver.evaluate.tune.result import Fold, Settings, Trial, TuneResult, model_of
from motionserver.evaluate.tune.space import Value, near, pool
from motionserver.evaluate.tune.stretches import Stretch


class Search:
    """One search; `run` does all of it.

    Args:
        machine: The platform.
        stretches: What is driven.
        settings: What is searched.
        cache: Results so far.
        processes: That drive at the same time; 0 drives in this one.
        progress: Called after every drive.
    """

    def __init__(
        self,
        machine: Machine,
        stretches: tuple[Stretch, ...],
        settings: Settings,
        cache: ResultCache,
        processes: int = 0,
        progress: Progress | None = None,
    ) -> None:
        self._machine = machine
        self._stretches = stretches
        self._settings = settings
        self._cache = cache
        self._processes = processes
        self._progress = progress
        self._trials: list[Trial] = []
        self._numbers: dict[tuple[tuple[str, Value], ...], int] = {}

    def run(self, command: str) -> TuneResult:
        """Drive the pool, choose, refine if asked, choose again.

        Raises:
            ConfigError: No trial is left in the running.
        """
        settings, names = self._settings, [stretch.name for stretch in self._stretches]
        start: dict[str, Value] = {p.name: getattr(settings.base, p.name) for p in settings.space}
        common = self._admit([("default", start)])
        points = pool(settings.space, settings.trials - 1, settings.seed)
        common += self._admit(("pool", values) for values in points)
        self._drive(common, names, "pool")
        views = {name: [other for other in names if other != name] for name in names}
        views[""] = names
        running = {held: list(common) for held in views}
        if settings.refine > 0:
            for held, seen in views.items():
                best = self._choose(held, running[held], seen).trial
                close = near(settings.space, best.values, settings.refine, settings.seed)
                added = self._admit((f"near {best.number}", values) for values in close)
                # judged on the held-out recording as well, but only after the choice is made
                self._drive(added, names, f"near {best.number}")
                running[held] += [n for n in added if n not in running[held]]
        folds = {held: self._choose(held, running[held], seen) for held, seen in views.items()}
        return TuneResult(
            settings,
            self._machine,
            self._stretches,
            tuple(self._trials),
            folds[""],
            tuple(folds[name] for name in names),
            command,
        )

    def _admit(self, points: Iterable[tuple[str, dict[str, Value]]]) -> list[int]:
        """Numbers of the trials with these values; equal values are one trial."""
        numbers = []
        for origin, values in points:
            key = tuple(values.items())
            if key not in self._numbers:
                self._numbers[key] = len(self._trials)
                model = model_of(self._settings.base, values)
                self._trials.append(Trial(len(self._trials), origin, values, model, {}))
            if self._numbers[key] not in numbers:
                numbers.append(self._numbers[key])
        return numbers

    def _drive(self, numbers: Sequence[int], names: Sequence[str], label: str) -> None:
        wanted = [
            (number, stretch)
            for number in numbers
            for stretch in self._stretches
            if stretch.name in names and stretch.name not in self._trials[number].outcomes
        ]
        jobs = [
            Job(
                self._machine,
                stretch,
                self._trials[number].model.to_tuning(),
                self._settings.base.scale,
                self._settings.planner_hz,
            )
            for number, stretch in wanted
        ]
        outcomes = drive_all(jobs, self._cache, self._processes, label, self._progress)
        found: dict[int, dict[str, Outcome]] = {number: {} for number in numbers}
        for (number, stretch), outcome in zip(wanted, outcomes, strict=True):
            found[number][stretch.name] = outcome
        for number, more in found.items():
            trial = self._trials[number]
            self._trials[number] = replace(trial, outcomes=trial.outcomes | more)

    def _choose(self, held_out: str, numbers: Sequence[int], seen: Sequence[str]) -> Fold:
        """The least score on the recordings that may be seen; a tie goes to the earlier trial."""
        default = self._trials[0].outcomes
        threshold = self._settings.base.to_tuning().tilt_rate
        scored = []
        for number in numbers:
            outcomes = {name: self._trials[number].outcomes[name] for name in seen}
            if not objection(outcomes, default, threshold):
                score = self._settings.criterion.mean(list(outcomes.values()))
                scored.append((score, number))
        if not scored:
            raise ConfigError(
                "tune",
                f"none of {len(numbers)} trials keeps the limits, the defaults included",
                "Look at the recordings with 'motionserver evaluate' first.",
            )
        score, number = min(scored)
        return Fold(held_out, self._trials[number], score, len(scored))
