"""Plan and check in lock-step, with a stopwatch: one case of the plan benchmark."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from time import monotonic, perf_counter, perf_counter_ns, sleep, thread_time_ns
from typing import Final

import numpy as np
from motion_clients.recording import RecordedSample, read_recording, recording_path

from motionserver.core.axes import GRAVITY, Array, frozen
from motionserver.core.intake.intake import Head, Intake
from motionserver.core.kinematics.rotation import felt, gravity_in_body
from motionserver.core.limits import Machine
from motionserver.core.motion.player import Playback, advance, follow, state_now
from motionserver.core.plan import Plan, pack
from motionserver.core.safety.accept import accept_proposal, accept_rest
from motionserver.core.safety.verdict import Rejection
from motionserver.core.state import PlatformState, Stimulus, VehicleMotion
from motionserver.cueing.base import Candidate, Cueing, Report
from motionserver.cueing.mpc import SixAxis
from motionserver.cueing.registry import Maker, make_cueing
from motionserver.cueing.think import Thinker
from motionserver.cueing.tuning import Tuning
from motionserver.evaluate.bench.processes import BenchError
from motionserver.evaluate.bench.report import Row, row_of_samples

PERIOD: Final = 0.01
RECORDING: Final = "truck_lanechange_slalom"
LIVELY: Final = 2200
"""Sample of it from which on it is never dull for twenty seconds, for short stretches."""
KERNEL_SIZE: Final = 96
"""Rows of the square matrices whose product is the yardstick."""
TIMED: Final = "t_"
"""Numbers of an algorithm's report that begin so are durations [s]."""
_KERNEL_EVERY: Final = 5


@dataclass(slots=True)
class Clocked:
    """A cueing algorithm with a stopwatch around its `propose`."""

    inner: Cueing
    name: str = "clocked"
    propose_ns: int = 0

    @property
    def disturbance(self) -> Array:
        """The algorithm's."""
        return self.inner.disturbance

    @disturbance.setter
    def disturbance(self, value: Array) -> None:
        self.inner.disturbance = value

    def propose(
        self, start: PlatformState, parent: Plan, takeover: float, stimulus: Stimulus
    ) -> Candidate | None:
        """Time the algorithm's."""
        began = perf_counter_ns()
        candidate = self.inner.propose(start, parent, takeover, stimulus)
        self.propose_ns = perf_counter_ns() - began
        return candidate

    def adopt(self, plan: Plan, kappa: float) -> None:
        """The algorithm's."""
        self.inner.adopt(plan, kappa)

    def retune(self, tuning: Tuning) -> None:
        """The algorithm's."""
        self.inner.retune(tuning)

    def report(self) -> Report:
        """The algorithm's."""
        return self.inner.report()


@dataclass(slots=True)
class Times:
    """What one case took, per period [ns], and what became of its plans.

    ``parts`` are those of `propose` that the algorithm itself tells; ``error`` is felt minus
    wanted specific force at each hand-over, (3,) [m/s2].
    """

    period: list[int] = field(default_factory=list)
    cpu: list[int] = field(default_factory=list)
    propose: list[int] = field(default_factory=list)
    govern: list[int] = field(default_factory=list)
    verify: list[int] = field(default_factory=list)
    kernel: list[int] = field(default_factory=list)
    iterations: list[int] = field(default_factory=list)
    parts: dict[str, list[int]] = field(default_factory=dict)
    error: list[Array] = field(default_factory=list)
    outcomes: Counter[str] = field(default_factory=Counter)

    def rows(self, name: str) -> list[Row]:
        """The whole period first, then its parts, then the guard's own check."""
        count = len(self.period)
        kernel = float(np.median(self.kernel)) if self.kernel else 1.0
        iterations = np.asarray(self.iterations)
        shares = {
            what: f"{self.outcomes[what] / count:.2%}"
            for what in ("no plan", "attenuated", "refused", "rejected by guard")
        }
        notes = {
            "kernels (p50)": round(float(np.median(self.period)) / kernel, 1),
            "iterations p50": int(np.quantile(iterations, 0.5)),
            "max": int(iterations.max()),
            **shares,
        }
        return [
            row_of_samples(name, self.period, **notes),
            row_of_samples("  CPU time of it", self.cpu),
            row_of_samples("  propose", self.propose),
            *(row_of_samples(f"    {part}", times) for part, times in self.parts.items()),
            row_of_samples("  govern", self.govern),
            row_of_samples("  guard's check", self.verify),
        ]

    def force_rmse(self) -> float:
        """Root of the mean squared error of the felt specific force [m/s2]."""
        return float(np.sqrt(np.mean(np.sum(np.square(self.error), axis=1))))


def _timed(cueing: Cueing) -> Cueing:
    """Give a clock to an algorithm that tells what its parts take."""
    if isinstance(cueing, SixAxis):
        cueing.clock = perf_counter
    return cueing


def time_plans(
    machine: Machine,
    tuning: Tuning,
    ticks: int,
    paced: bool = True,
    make: Maker = make_cueing,
    begin: int = 0,
) -> Times:
    """Drive for ``ticks`` periods of the recording at 100 Hz and time every one.

    Each period takes the packet in, proposes, governs with the planner's check and packs; the
    guard's acceptance is timed beside it. Plans take over one period later, as live.

    Args:
        machine: Geometry and limits.
        tuning: Algorithm, backend and the rest.
        ticks: How many periods.
        paced: Wait for each period to begin, so that caches are as cold as live; else as fast as
            it goes.
        make: Makes the algorithm.
        begin: Sample of the recording it begins with.

    Raises:
        BenchError: The machine cannot stand at neutral.
    """
    homes = np.stack((np.zeros(6), machine.parked_pose))
    rest = accept_rest(machine, np.zeros(6), 0, homes)
    if isinstance(rest, Rejection):
        raise BenchError(f"bench plan: {machine.name} cannot stand at neutral ({rest})")
    thinker = Thinker(machine, tuning, PERIOD, homes)
    thinker.cueing = clocked = Clocked(_timed(make(machine, tuning, PERIOD)))
    intake, head = Intake(), Head(np.zeros(3), tuning.scale)
    playback, out = Playback(rest), Times()
    left = right = np.random.default_rng(0).standard_normal((KERNEL_SIZE, KERNEL_SIZE))
    due = monotonic()
    for number, motion in zip(range(1, ticks + 1), _motions(begin), strict=False):
        if thinker.cueing is not clocked:
            # it raised: the thinker makes a fresh one then
            thinker.cueing = clocked = Clocked(_timed(thinker.cueing))
        due += PERIOD
        if paced:
            sleep(max(0.0, due - monotonic()))
        parent = playback.newest
        takeover = playback.newest_clock + PERIOD
        began, began_cpu = perf_counter_ns(), thread_time_ns()
        intake.offer(motion)
        stimulus = intake.stimulus(head, PERIOD, wanted=True)
        aware = perf_counter_ns()
        thought = thinker.think(parent.plan, parent.before, takeover, stimulus, number)
        thought_ns = perf_counter_ns() - aware
        if thought.proposal is not None:
            pack(thought.proposal.plan)
        out.period.append(perf_counter_ns() - began)
        out.cpu.append(thread_time_ns() - began_cpu)
        out.propose.append(clocked.propose_ns)
        out.govern.append(thought_ns - clocked.propose_ns)
        out.iterations.append(thought.report.iterations)
        for part in (name for name in thought.report.numbers if name.startswith(TIMED)):
            taken = round(thought.report.numbers[part] * 1e9)
            out.parts.setdefault(part.removeprefix(TIMED), []).append(taken)
        if thought.proposal is None:
            out.outcomes["no plan"] += 1
        else:
            kappa = thought.proposal.kappa
            out.outcomes["attenuated" if 0.0 < kappa < 1.0 else "whole"] += kappa > 0.0
            out.outcomes["refused"] += kappa == 0.0
            began = perf_counter_ns()
            plan, now = thought.proposal.plan, playback.newest_clock
            verdict = accept_proposal(machine, plan, parent, now, homes)
            out.verify.append(perf_counter_ns() - began)
            if isinstance(verdict, Rejection):
                out.outcomes["rejected by guard"] += 1
            else:
                playback = follow(playback, verdict)
        playback = advance(playback, PERIOD)
        state = state_now(playback)
        force, _ = felt(state.pose, state.velocity, state.acceleration, machine.head)
        out.error.append(force - np.array([0.0, 0.0, GRAVITY]) - stimulus.force)
        if number % _KERNEL_EVERY == 0:
            began = perf_counter_ns()
            left = left @ right / KERNEL_SIZE
            out.kernel.append(perf_counter_ns() - began)
    return out


def _motions(begin: int) -> Iterator[VehicleMotion]:
    """The recording at 100 Hz, forwards and backwards in turn: no jump where it begins anew."""
    samples = read_recording(recording_path(RECORDING)).samples
    there_and_back = itertools.cycle((*samples, *reversed(samples)))
    for number, sample in enumerate(itertools.islice(there_and_back, begin, None)):
        stamp = round(number * PERIOD * 1e9)
        force = frozen(np.asarray(sample.acceleration) + _gravity(sample))
        rates = frozen(sample.rates)
        yield VehicleMotion(stamp, 1, number, stamp, force, rates, sample.speed)


def _gravity(sample: RecordedSample) -> Array:
    roll, pitch = sample.attitude
    return gravity_in_body(np.array(roll), np.array(pitch))
