"""Drive every sine with every algorithm and read gain and phase."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import degrees, radians
from typing import Final

import numpy as np

from motionserver.core.axes import Array
from motionserver.core.limits import Machine
from motionserver.cueing.tuning import Tuning
from motionserver.evaluate.lockstep import drive
from motionserver.evaluate.metrics.workspace import workspace_figures
from motionserver.evaluate.omct.sines import (
    ENTRIES,
    FREQUENCIES,
    TESTS,
    Sine,
    Test,
    bin_of,
    make_sine,
    tilt_shown,
    to_recording,
)
from motionserver.evaluate.worker_pool import worker_pool

PLANNER_HZ: Final = 50.0
"""Planner rate unless told otherwise [Hz]."""
SLOW: Final = 0.5
"""Below this frequency the planner runs at half its rate, 20 Hz at least [rad/s]."""
RATE_HZ: Final = 250.0
"""Rate of judging [Hz]."""
_LEAST: Final = 1e-9
Told = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Point:
    """Answer of one test at one frequency.

    Attributes:
        omega: Frequency [rad/s].
        gain: Felt over wanted [-].
        phase: Of felt against wanted, continued from the frequency before [deg].
    """

    omega: float
    gain: float
    phase: float


@dataclass(frozen=True, slots=True)
class Response:
    """One test of one algorithm.

    Attributes:
        algorithm: Name.
        test: Which of the ten.
        points: By frequency.
    """

    algorithm: str
    test: Test
    points: tuple[Point, ...]

    @property
    def delay(self) -> float:
        """Time by which the highest frequency is late [s]."""
        last = self.points[-1]
        return -radians(last.phase) / last.omega


@dataclass(frozen=True, slots=True)
class Answer:
    """What one drive gives.

    Attributes:
        ratios: Complex felt over wanted by number of test.
        violations: Executed samples beyond any limit; must be 0.
    """

    ratios: dict[int, complex]
    violations: int


@dataclass(frozen=True, slots=True)
class Omct:
    """All responses.

    Attributes:
        responses: Algorithm by algorithm, test by test.
        violations: Executed samples beyond any limit, over all drives; must be 0.
        seconds: Length of all drives [s].
    """

    responses: tuple[Response, ...]
    violations: int
    seconds: float


def run_omct(
    machine: Machine,
    tuning: Tuning,
    algorithms: Sequence[str],
    *,
    force: float,
    planner_hz: float = PLANNER_HZ,
    frequencies: Sequence[float] = FREQUENCIES,
    jobs: int = 1,
    tell: Told | None = None,
) -> Omct:
    """Measure.

    Args:
        machine: Geometry, hard limits and head point.
        tuning: Tunables; the algorithm is replaced.
        algorithms: Names.
        force: Amplitude of force inputs before scaling [m/s2].
        planner_hz: Planner rate [Hz].
        frequencies: Increasing [rad/s].
        jobs: Processes at the same time; the result does not depend on it.
        tell: Called with a line of progress.

    Returns:
        Gain and phase of the ten tests for each algorithm.
    """
    tasks = [
        (name, make_sine(entry, omega, force))
        for name in algorithms
        for omega in frequencies
        for entry in ENTRIES
    ]
    tasks.sort(key=lambda task: -task[1].end)
    work = partial(_answer, machine, tuning, planner_hz)
    answers: dict[tuple[str, str, float], Answer] = {}

    def take(task: tuple[str, Sine], answer: Answer) -> None:
        name, sine = task
        answers[name, sine.entry, sine.omega] = answer
        if tell is not None:
            done = f"{len(answers)}/{len(tasks)}"
            tell(f"{done} {name}: {sine.entry} at {sine.omega:g} rad/s, {sine.end:.0f} s")

    if jobs <= 1:
        for task in tasks:
            take(task, work(task))
    else:
        with worker_pool(min(jobs, len(tasks))) as pool:
            for task, answer in zip(tasks, pool.map(work, tasks), strict=True):
                take(task, answer)
    responses = tuple(
        Response(
            name,
            test,
            _continued(
                frequencies,
                [answers[name, test.entry, omega].ratios[test.number] for omega in frequencies],
            ),
        )
        for name in algorithms
        for test in TESTS
    )
    broken = sum(answer.violations for answer in answers.values())
    return Omct(responses, broken, sum(sine.end for _, sine in tasks))


def _answer(machine: Machine, tuning: Tuning, planner_hz: float, task: tuple[str, Sine]) -> Answer:
    name, sine = task
    slow = sine.omega < SLOW
    driven = drive(
        machine,
        to_recording(sine),
        replace(tuning, algorithm=name),
        rate=RATE_HZ,
        planner_hz=max(20.0, planner_hz / 2.0) if slow else planner_hz,
    )
    force, rates = driven.felt()
    shown = tilt_shown(driven.pose)
    signals = {"tilt_x": shown[:, 0], "tilt_y": shown[:, 1]}
    wanted = {}
    for axis, letter in enumerate("xyz"):
        signals[f"f_{letter}"], signals[f"w_{letter}"] = force[:, axis], rates[:, axis]
        wanted[f"f_{letter}"] = driven.wanted_force[:, axis]
        wanted[f"w_{letter}"] = driven.wanted_rates[:, axis]
    kept = (driven.times >= sine.begin) & (driven.times < sine.end)
    times = driven.times[kept]

    def amplitude(signal: Array) -> complex:
        return bin_of(signal[kept], times, sine.omega)

    ratios = {
        test.number: amplitude(signals[test.output]) / amplitude(wanted[test.against])
        for test in TESTS
        if test.entry == sine.entry
    }
    figures = workspace_figures(machine, driven.pose, driven.legs, 1.0 / driven.rate)
    return Answer(ratios, figures.violations)


def _continued(frequencies: Sequence[float], ratios: list[complex]) -> tuple[Point, ...]:
    """Points whose phase goes on from one frequency to the next without a turn."""
    # a gain of nothing has no phase: that of the neighbour is as good
    phases: list[float] = []
    for ratio in ratios:
        phase = degrees(float(np.angle(ratio))) if abs(ratio) > _LEAST else None
        last = phases[-1] if phases else 0.0
        phase = last if phase is None else phase
        phases.append(phase + 360.0 * round((last - phase) / 360.0))
    return tuple(
        Point(omega, abs(ratio), phase)
        for omega, ratio, phase in zip(frequencies, ratios, phases, strict=True)
    )
