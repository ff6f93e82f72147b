"""Think and act in lock-step on a manual clock: the server's own code, faster than real time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from time import perf_counter
from typing import Final

import numpy as np

from motionserver.core.axes import Array, frozen
from motionserver.core.intake.freshness import SECOND_NS
from motionserver.core.intake.gate import Gate
from motionserver.core.intake.intake import Head, Intake
from motionserver.core.limits import Machine
from motionserver.core.motion.player import Playback, advance, follow
from motionserver.core.safety.accept import accept_proposal, accept_rest
from motionserver.core.safety.verdict import AcceptedPlan, Rejection
from motionserver.cueing.think import Thinker
from motionserver.cueing.tuning import Tuning
from motionserver.evaluate.disturbance import Disturbance, Trouble
from motionserver.evaluate.drive import RATE_HZ, Drive, Periods, assemble
from motionserver.evaluate.hearing import Hearing
from motionserver.evaluate.recording import Recording

PLANNER_HZ: Final = 100.0
"""Planner rate unless told otherwise [Hz]."""
Progress = Callable[[float], None]


@dataclass(slots=True)
class _Log:
    times: list[float] = field(default_factory=list)
    kappa: list[float] = field(default_factory=list)
    iterations: list[int] = field(default_factory=list)
    x_max: list[Array] = field(default_factory=list)
    force: list[Array] = field(default_factory=list)
    rates: list[Array] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    refusals: Counter[str] = field(default_factory=Counter)
    rejections: Counter[str] = field(default_factory=Counter)
    troubles: Counter[str] = field(default_factory=Counter)
    gate: Counter[str] = field(default_factory=Counter)

    def periods(self) -> Periods:
        return Periods(
            frozen(self.times),
            frozen(self.kappa),
            frozen(self.iterations),
            frozen(self.x_max),
            frozen(self.force),
            frozen(self.rates),
            frozen(self.seconds),
            dict(sorted(self.refusals.items())),
            dict(sorted(self.rejections.items())),
            dict(sorted(self.troubles.items())),
            dict(sorted(self.gate.items())),
        )


def drive(
    machine: Machine,
    recording: Recording,
    tuning: Tuning,
    *,
    rate: float = RATE_HZ,
    planner_hz: float = PLANNER_HZ,
    vehicle_head: Array | None = None,
    preview: float = 0.0,
    thinker: Thinker | None = None,
    disturbance: Disturbance | None = None,
    progress: Progress | None = None,
) -> Drive:
    """Drive a recording through gate, intake, planner, governor, verification and player.

    It begins at neutral, running, and ends with the last sample; without fade-in, and every plan
    takes over one planner period after it was begun. What `motionserver record` wrote fades in and
    takes over as it did live, by a planner that is never late.

    Args:
        machine: Geometry and hard limits.
        recording: What the vehicle did.
        tuning: Algorithm and tunables; its scale is the share of the motion that is wanted.
        rate: Rate of the executed samples [Hz].
        planner_hz: Planner rate [Hz].
        vehicle_head: Driver's head from the recorded point, vehicle axes, (3,) [m]; zero if None.
        preview: How far the recording itself is told ahead, as by a simulator that knows what
            comes [s], at most 4; 0 for none. No more than one packet carries.
        thinker: Another planner than that of ``tuning``.
        disturbance: Late, failed and senseless plans; none if None.
        progress: Called about once per second of the drive with the share done, 0..1.

    Returns:
        Everything wanted and executed.

    Raises:
        ValueError: A rate is not positive, the preview too long, or neutral no pose of this
            machine.
    """
    if not (np.isfinite(rate) and rate > 0.0 and np.isfinite(planner_hz) and planner_hz > 0.0):
        raise ValueError(
            f"rates must be positive: sample rate {rate:g} Hz, planner rate {planner_hz:g} Hz"
        )
    period = 1.0 / planner_hz
    homes = machine.parked_pose[None]
    head = Head(np.zeros(3) if vehicle_head is None else vehicle_head, tuning.scale)
    mind = Thinker(machine, tuning, period, homes) if thinker is None else thinker
    playback = Playback(_standing(machine, homes))
    live = recording.live
    # a live drive fades in, and its plans take over at the next packet to the platform
    lead = period if live is None else min(live.lead, period)
    intake, gate, log = Intake(gain=1.0 if live is None else 0.0), Gate(), _Log()

    samples = int(np.floor(recording.duration * rate + 1e-6)) + 1
    states = np.empty((samples, 18))
    hearing = Hearing(recording, preview, gate, intake, log.gate)
    trouble = None if disturbance is None else Trouble(disturbance, period)
    count, now = 0, 0.0
    for number in range(int(np.floor(recording.duration * planner_hz + 1e-6)) + 1):
        start, end = number / planner_hz, (number + 1) / planner_hz
        playback, now = advance(playback, start - now), start
        now_ns = round(start * SECOND_NS)
        hearing.until(start)
        wanted = intake.stimulus(head, period, gate.is_fresh(now_ns))

        if trouble is not None:
            trouble.ride(mind)
        before = perf_counter()
        parent = playback.newest
        thought = mind.think(
            parent.plan, parent.before, playback.newest_clock + lead, wanted, number + 1
        )
        log.seconds.append(perf_counter() - before)
        log.times.append(start)
        log.force.append(wanted.force)
        log.rates.append(wanted.rates)
        log.iterations.append(thought.report.iterations)
        log.x_max.append(thought.report.x_max)
        if thought.proposal is None:
            log.kappa.append(float("nan"))
            log.troubles[thought.trouble] += 1
        else:
            log.kappa.append(thought.proposal.kappa)
            if thought.proposal.refusals:
                log.refusals[str(thought.proposal.refusals[0].reason)] += 1
            plan = thought.proposal.plan
            verdict = accept_proposal(machine, plan, parent, playback.newest_clock, homes)
            if isinstance(verdict, Rejection):
                log.rejections[str(verdict.reason)] += 1
            else:
                playback = follow(playback, verdict)

        played: list[Playback] = []
        while (
            count + len(played) < samples and (instant := (count + len(played)) / rate) < end - 1e-9
        ):
            playback, now = advance(playback, max(0.0, instant - now)), max(now, instant)
            played.append(playback)
        states[count : count + len(played)] = _states(played)
        count += len(played)
        if progress is not None and number % round(max(planner_hz, 1.0)) == 0:
            progress(count / samples)
    return assemble(
        tuning.algorithm,
        machine,
        recording,
        rate,
        (states[:count, :6], states[:count, 6:12], states[:count, 12:]),
        tuning.scale,
        vehicle_head,
        log.periods(),
    )


def _standing(machine: Machine, homes: Array) -> AcceptedPlan:
    rest = accept_rest(machine, np.zeros(6), 0, homes)
    if isinstance(rest, Rejection):
        raise ValueError(
            f"machine {machine.name}: the platform cannot stand at neutral ({rest}); "
            "check its legs and joints"
        )
    return rest


def _states(samples: list[Playback]) -> Array:
    """Pose, velocity and acceleration of each of them, (N, 18): one evaluation for each plan."""
    out = np.empty((len(samples), 18))
    begin = 0
    while begin < len(samples):
        plan = samples[begin].playing.plan
        end = begin
        while end < len(samples) and samples[end].playing.plan is plan:
            end += 1
        clocks = np.array([sample.clock for sample in samples[begin:end]])
        out[begin:end] = np.concatenate(plan.evaluate(clocks), axis=1)
        begin = end
    return out
