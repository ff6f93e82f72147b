"""The planner's loop: wake before a send slot, read inputs, think, propose, show."""

from __future__ import annotations

import asyncio
import gc
import logging
import signal
from pathlib import Path
from typing import Any, Final

import numpy as np

from motionserver.core.axes import GRAVITY, Array, frozen
from motionserver.core.intake.intake import Head, Intake
from motionserver.core.kinematics.rotation import felt
from motionserver.core.plan import pack
from motionserver.core.safety.patient import time_of_check
from motionserver.core.safety.states import CUED, State
from motionserver.core.state import STILL, Stimulus, VehicleMotion
from motionserver.cueing.measured import MeasuredForce
from motionserver.cueing.think import Thinker, Thought
from motionserver.cueing.tuning import Tuning
from motionserver.planner.handover import Handover, HandoverClock
from motionserver.planner.inputs import Inputs, open_input
from motionserver.planner.options import PlannerOptions
from motionserver.planner.reply import StatusSender
from motionserver.planner.session_file import keeper_of
from motionserver.planner.show import PlannerView, Timing
from motionserver.planner.sides import Sides
from motionserver.planner.source_notices import NoticeLog, notices_of
from motionserver.planner.source_report import SourceReport
from motionserver.planner.tuner import Tuner
from motionserver.planner.wake import next_wake
from motionserver.planner.wake_ahead import MARGIN_NS, WakeAhead
from motionserver.telemetry.blackbox.planner_box import PlannerBox
from motionserver.telemetry.cue_history import CueNotes
from motionserver.telemetry.link import Maps, pack_cue
from motionserver.telemetry.logs import Seldom
from motionserver.telemetry.memory import lock_memory
from motionserver.telemetry.oom import PLANNER, set_oom_score
from motionserver.telemetry.realtime import take_priority
from motionserver.telemetry.requests import RequestServer
from motionserver.telemetry.signals import let_through
from motionserver.telemetry.ticker import Ticker, now_ns, ticks_per_send

SECOND: Final = 1_000_000_000
BEGUN: Final = frozenset({State.RUN, State.HOLD})
"""States of a drive that has begun."""
SNAPSHOT_NS: Final = 30_000_000
PRIORITY: Final = 30
"""SCHED_FIFO priority: below the guard's."""
UP: Final = frozen([0.0, 0.0, GRAVITY])

log = logging.getLogger("motionserver.planner")


class PlannerLoop:
    """One planner for one guard."""

    def __init__(self, options: PlannerOptions, run_dir: Path) -> None:
        self.options = options
        self._maps = Maps(run_dir)
        self._requests = RequestServer(run_dir / "planner.sock")
        self._tuner = Tuner(options)
        homes = frozen(np.stack((np.zeros(6), options.machine.parked_pose)))
        self._thinker = Thinker(
            options.machine, self._tuner.tuning(), options.period, homes, self._tuner.cueing
        )
        self._sides = Sides(options.machine, options.period, homes, self._tuner.side)
        self._state: State | None = None
        self._inputs = Inputs(
            [open_input(one) for one in options.inputs],
            lambda: self._state not in (State.RUN, State.HOLD),
            keeper_of(options, run_dir),
            int(options.period * SECOND),
        )
        self._source_report = SourceReport(self._inputs)
        self._replies = StatusSender(self._inputs)
        self._notice_log = NoticeLog(log)
        self._intake = Intake()
        self._measured = MeasuredForce()
        self._measured_ns = 0
        self._timing = Timing(int(options.period * SECOND))
        self._view = PlannerView()
        self._box = PlannerBox(run_dir)
        self._cues = CueNotes(run_dir)
        self._seldom = Seldom(log)
        # a guard of short ticks needs some of them for its verdict
        tick = options.send_period / ticks_per_send(1.0 / options.send_period)
        self._check_ns = int(time_of_check(tick) * SECOND)
        self._clock = HandoverClock(self._maps, options.send_period, options.period, self._check_ns)
        self._ahead = WakeAhead(
            int(options.budget * SECOND), int(options.period * SECOND), self._check_ns
        )
        self._snapshot_ns = 0
        self._ticker: Ticker | None = None
        self._due_ns = 0

    async def run(self) -> int:
        """Run until terminated."""
        loop = asyncio.get_running_loop()
        self._done: asyncio.Future[int] = loop.create_future()
        loop.add_signal_handler(signal.SIGTERM, self._finish)
        let_through()
        gc.collect()
        gc.freeze()
        gc.disable()
        scheduling = take_priority(PRIORITY, self.options.realtime)
        memory = lock_memory(self.options.realtime)
        self.scheduling = f"{scheduling}, {memory}, {set_oom_score(PLANNER)}"
        self._ticker = Ticker(self._wake)
        self._arm(now_ns())
        log.info("planner ready: %s; %s", self._thinker.tuning.algorithm, self.scheduling)
        try:
            return await self._done
        finally:
            self._ticker.close()
            self._inputs.close()
            self._requests.close()

    def _finish(self) -> None:
        if not self._done.done():
            self._done.set_result(0)

    def _wake(self) -> None:
        woken = now_ns()
        self._timing.woke(woken - self._due_ns)
        try:
            self._step(woken)
        except Exception:
            self._inputs.counters["tick_errors"] += 1
            self._seldom.exception(woken, "period failed; the accepted plan plays on")
        self._arm(now_ns())

    def _arm(self, now: int) -> None:
        """Wake ahead of a send slot; at the plain period while no guard is heard."""
        period = int(self.options.period * SECOND)
        clock = self._clock.clock
        if clock is None:
            wake = max(self._due_ns + period, now)
        else:
            slot = int(self.options.send_period * SECOND)
            first = clock.due_ns - self._ahead.ahead_ns
            wake = next_wake(first, slot, self._due_ns + period, period, now)
        self._due_ns = wake
        if self._ticker is not None:
            self._ticker.arm(wake)

    def _step(self, now: int) -> None:
        vehicle, sensor = self._inputs.poll()
        self._box.packets((*vehicle, *sensor))
        self._cues.note(vehicle)
        for motion in vehicle:
            self._intake.offer(motion)
        self._state = self._clock.read(now)
        gate = self._inputs.vehicle
        status = self._source_report.status(now, self._state in BEGUN)
        self._maps.cue.write(pack_cue(status, now))
        tuning = self._thinker.tuning
        wanted = self._state is State.RUN and gate.is_fresh(now)
        head = Head(self.options.arm, tuning.scale)
        stimulus = self._intake.stimulus(head, self.options.period, wanted)
        if self._state not in CUED:
            stimulus = STILL
            self._intake.gain = 0.0
        # late for its slot it aims at the next one; early it does not hurry
        ready = max(now + self._timing.expected_ns + self._check_ns, self._ready_ns())
        handover = self._clock.handover(now, ready - now)
        if handover is not None:
            self._think(now, handover, stimulus, sensor)
        self._serve(handover)
        self._status(now)
        self._sides.make_one(self._thinker.tuning)
        if handover is not None:
            self._sides.think(stimulus, self._due_ns + int(self.options.period * SECOND))
        elif self._state not in CUED:
            self._thinker.settle()
            self._sides.stand()
        else:
            self._thinker.ramp()
        self._tuner.look(self._thinker)
        self._show(now, stimulus, handover is not None)

    def _ready_ns(self) -> int:
        """When the plan of this period is to be ready: just before its send slot [ns]."""
        return self._due_ns + self._ahead.ahead_ns - MARGIN_NS

    def _show(self, now: int, stimulus: Stimulus, has_thought: bool) -> None:
        trace = self._view.trace(
            now, stimulus, self._thinker, self._sides, self._timing, has_thought
        )
        self._maps.trace.write(trace)
        self._box.period(trace)
        self._box.count(now, lambda: self._view.counted(self._inputs, self._sides))
        if now - self._snapshot_ns > SNAPSHOT_NS:
            self._snapshot_ns = now
            self._maps.planner.write(
                self._view.snapshot(
                    now,
                    self._thinker,
                    self._inputs,
                    self._timing,
                    self._tuner,
                    self._measured,
                    self._sides,
                    {**self._clock.shown(), "ahead_ms": round(self._ahead.ahead_ns / 1e6, 2)},
                )
            )

    def _think(
        self, now: int, handover: Handover, stimulus: Stimulus, sensor: list[VehicleMotion]
    ) -> None:
        parent = handover.parent
        model = self._felt(handover)
        self._compare(now, sensor, model)
        self._thinker.cueing.disturbance = self._measured.disturbance
        begun = now_ns()
        thought: Thought = self._thinker.think(
            parent, handover.before, handover.takeover, stimulus, now
        )
        took = now_ns() - begun
        done = now_ns()
        if thought.proposal is not None:
            plan = thought.proposal.plan
            if self._clock.may_propose(plan, done):
                packed = pack(plan)
                self._maps.proposal.write(packed)
                self._box.proposed(packed)
                self._clock.proposed(plan, done)
            else:
                self._inputs.counters["plans_withheld"] += 1
        self._timing.thought(done - now)
        self._ahead.took(done - now + self._timing.late_ns)
        scores, proposal = self._sides.driving, thought.proposal
        scores.heard(parent, handover.takeover, stimulus)
        scores.thought(None if proposal is None else proposal.kappa, took / SECOND)
        self._view.note(thought, stimulus, model - UP, self._thinker.tuning.algorithm)

    def _felt(self, handover: Handover) -> Array:
        """What the person feels about now, gravity included, (3,) [m/s2]."""
        state = handover.parent.state(handover.takeover)
        force, _ = felt(state.pose, state.velocity, state.acceleration, self.options.machine.head)
        return force

    def _compare(self, now: int, sensor: list[VehicleMotion], model: Array) -> None:
        if sensor:
            mean = np.mean([motion.force for motion in sensor], axis=0)
            elapsed = min(0.1, (now - self._measured_ns) / SECOND)
            self._measured.update(mean, model, elapsed)
            self._measured_ns = now
        elif now - self._measured_ns > SECOND // 5:
            self._measured.lost()

    def _serve(self, handover: Handover | None) -> None:
        for message, address in self._requests.poll():
            if message["op"] == "side":
                answer = self._tuner.serve_side(message, self._sides, self._thinker.tuning)
            else:
                answer, tuning = self._tuner.serve(message, self._thinker)
                if tuning is not None:
                    refusal = self._retune(tuning, handover)
                    answer = refusal or self._tuner.accepted(self._thinker)
            self._requests.answer(address, answer)

    def _retune(self, tuning: Tuning, handover: Handover | None) -> dict[str, Any] | None:
        """Take another tuning; the refusal if it names what cannot be made."""
        former, cueing = self._thinker.tuning.algorithm, self._thinker.cueing
        try:
            warm = self._sides.warm(tuning.algorithm)
            self._thinker.retune(tuning, warm, self._tuner.taking_over())
        except Exception as error:
            return self._tuner.take_back(f"{tuning.algorithm} cannot be made: {error}")
        if tuning.algorithm == former:
            self._sides.retune(tuning)
        else:
            log.info("%s takes over from %s", tuning.algorithm, former)
            where = (None, 0.0) if handover is None else (handover.parent, handover.takeover)
            self._sides.switched(tuning, former, cueing, *where)
            self._tuner.keep_side(self._sides.wanted)
        return None

    def _status(self, now: int) -> None:
        """Answer the owner, and write to the log what is wrong with its packets."""
        notices = notices_of(self._inputs, now)
        self._notice_log.note(now, notices)
        scale = self._intake.gain * self._thinker.tuning.scale
        self._replies.send(now, self._intake.newest, self._state, scale, notices)
