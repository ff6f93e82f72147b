"""The engines beside the driving one: which run, when they may think, what they show."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from time import perf_counter
from typing import Any, Final

from motionserver.core.axes import Array
from motionserver.core.limits import Machine
from motionserver.core.plan import Plan
from motionserver.core.state import Stimulus
from motionserver.cueing.base import Cueing
from motionserver.cueing.scores import Figures, Scores
from motionserver.cueing.side import SideEngine
from motionserver.cueing.tuning import Tuning
from motionserver.planner.spare_time import Cost
from motionserver.settings.fields import FieldError, TuningError
from motionserver.telemetry.ticker import now_ns

RESERVE_NS: Final = 1_000_000
"""Kept free before the next wake-up, for whatever else the machine does [ns]."""

log = logging.getLogger("motionserver.planner")


class Sides:
    """The side engines of one planner, and the figures of all engines.

    Args:
        machine: Geometry and hard limits.
        period: Planner period [s].
        homes: Poses (H, 6) that must be reachable straight from a rest pose.
        wanted: Names of the engines that shall run beside.
        clock_ns: The clock [ns].

    Attributes:
        wanted: Names asked for; one that drives at present does not run a second time.
        driving: Figures of the driving engine.
        switches: How often another algorithm took over.
    """

    def __init__(
        self,
        machine: Machine,
        period: float,
        homes: Array,
        wanted: Sequence[str],
        clock_ns: Callable[[], int] = now_ns,
    ) -> None:
        self.wanted = tuple(wanted)
        self.driving = Scores(machine, period)
        self.switches = 0
        self._made_of = (machine, period, homes)
        self._engines: dict[str, SideEngine] = {}
        self._costs: dict[str, Cost] = {}
        self._failed: dict[str, str] = {}
        self._clock_ns = clock_ns
        self._turn = 0
        self._stands = True

    def want(self, names: Sequence[str]) -> None:
        """Run these beside from now on; engines that go on keep what they have."""
        self.wanted = tuple(names)
        self._failed.clear()
        for name in list(self._engines):
            if name not in self.wanted:
                del self._engines[name]

    @property
    def running(self) -> tuple[str, ...]:
        """Names of the engines that exist."""
        return tuple(self._engines)

    def take(self, names: Sequence[str], tuning: Tuning) -> None:
        """Run these beside from now on, once every one that is new has been made.

        Args:
            names: Known names, each once.
            tuning: The driving engine's tunables.

        Raises:
            TuningError: One cannot be made; then nothing has changed.
        """
        new = [n for n in names if n not in (*self._engines, tuning.algorithm)]
        errors = []
        for name in new:
            if self._make(tuning, name) is None:
                why = self._failed.pop(name)
                allowed = "an engine that can be made with the tuning in force"
                errors.append(FieldError("engines", name, allowed, f"{name} cannot be made: {why}"))
        if errors:
            for name in new:
                self._engines.pop(name, None)
            raise TuningError(errors)
        self.want(names)

    def make_one(self, tuning: Tuning) -> None:
        """Make one engine that is wanted and missing: more would take longer than a period."""
        for name in self.wanted:
            if name not in (*self._engines, *self._failed, tuning.algorithm):
                self._make(tuning, name)
                return

    def retune(self, tuning: Tuning) -> None:
        """Pass on the driving engine's tunables."""
        self._failed.clear()
        for engine in self._engines.values():
            engine.retune(tuning)

    def warm(self, algorithm: str) -> Cueing | None:
        """The algorithm of that name with all it has learnt beside, if it runs and is sound."""
        engine = self._engines.get(algorithm)
        return None if engine is None or engine.trouble else engine.cueing

    def switched(
        self, tuning: Tuning, former: str, cueing: Cueing, plan: Plan | None, takeover: float
    ) -> None:
        """Another algorithm has taken over: they change places.

        Figures belong to the algorithm and go along, so that all are of the same stretch of the
        drive.

        Args:
            tuning: The new tunables.
            former: The algorithm that drove until now.
            cueing: It.
            plan: The accepted plan; None if there is none.
            takeover: The next hand-over in its time [s].
        """
        self.switches += 1
        driving, scores = tuning.algorithm, self.driving
        beside = self._engines.pop(driving, None)
        if beside is not None and former not in self.wanted:
            self.wanted = tuple(former if name == driving else name for name in self.wanted)
        self.driving = Scores(*self._made_of[:2]) if beside is None else beside.scores
        self.driving.pause()
        if former in self.wanted:
            engine = self._make(tuning, former, cueing, scores)
            if engine is not None and plan is not None:
                engine.start_from(plan, takeover)
        self.retune(tuning)

    def think(self, stimulus: Stimulus, until_ns: int) -> None:
        """Let every engine pass one period; those think for which there is time.

        The first one changes every period, so that little time is shared.

        Args:
            stimulus: What the driving engine heard.
            until_ns: When the planner must wake again [ns].
        """
        self._stands = False
        names = list(self._engines)
        self._turn += 1
        for number in range(len(names)):
            name = names[(self._turn + number) % len(names)]
            engine, cost = self._engines[name], self._costs[name]
            begun = self._clock_ns()
            if cost.fits(begun, until_ns - RESERVE_NS - begun):
                engine.think(stimulus, perf_counter)
                ended = self._clock_ns()
                cost.took(ended, ended - begun)
            else:
                engine.skip(stimulus)

    def stand(self) -> None:
        """The platform is not cued: all stand at neutral until it is."""
        for engine in self._engines.values():
            engine.settle()
        if self._stands:
            return
        self._stands = True
        self.driving.pause()
        for engine in self._engines.values():
            engine.stand()

    def forces(self) -> dict[str, tuple[Array, float | None]]:
        """Felt force (3,) [m/s2] and kappa of every side engine, by name."""
        return {
            name: (engine.scores.felt, engine.scores.kappa)
            for name, engine in self._engines.items()
        }

    def shown(self, driving: str) -> dict[str, Any]:
        """What the page shows, for JSON."""
        engines: list[dict[str, Any]] = []
        for name in self.wanted:
            if name == driving:
                continue
            engine = self._engines.get(name)
            if engine is None:
                engines.append({"name": name, "trouble": self._failed.get(name, "")})
                continue
            engines.append(
                {
                    "name": name,
                    **_mapping(engine.scores.figures()),
                    "trouble": engine.trouble[:200],
                    **{key: engine.counters[key] for key in ("periods", "skipped", "raised")},
                }
            )
        return {
            "wanted": list(self.wanted),
            "driving": {"name": driving, **_mapping(self.driving.figures())},
            "engines": engines,
            "switches": self.switches,
        }

    def _make(
        self,
        tuning: Tuning,
        name: str,
        cueing: Cueing | None = None,
        scores: Scores | None = None,
    ) -> SideEngine | None:
        machine, period, homes = self._made_of
        try:
            engine = SideEngine(machine, tuning, name, period, homes, cueing, scores)
        except Exception as error:
            self._failed[name] = f"{type(error).__name__}: {error}"[:200]
            log.warning("side engine %s cannot be made: %s", name, error)
            return None
        self._engines[name], self._costs[name] = engine, Cost()
        return engine


def _mapping(figures: Figures) -> dict[str, Any]:
    return {
        "felt_force": [round(float(v), 5) for v in figures.felt],
        "rest_pose": [round(float(v), 5) for v in figures.rest_pose],
        "periods_judged": figures.periods,
        "rmse": _short(figures.rmse),
        "nrmse": _short(figures.nrmse),
        "kappa": figures.kappa,
        "kappa_whole": _short(figures.whole),
        "kappa_part": _short(figures.part),
        "kappa_refused": _short(figures.refused),
        "no_candidate": _short(figures.none),
        "think_p50_ms": None if figures.think_p50 is None else _short(1e3 * figures.think_p50),
        "think_p99_ms": None if figures.think_p99 is None else _short(1e3 * figures.think_p99),
        "leg_use": _short(figures.leg_use),
    }


def _short(value: float | None) -> float | None:
    return None if value is None else round(value, 4)
