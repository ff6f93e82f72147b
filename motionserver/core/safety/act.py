"""Act: one tick of the guard as a function of what came in, from events to a setpoint."""

from __future__ import annotations

import numpy as np

from motionserver.core.axes import Array, frozen
from motionserver.core.device import Order
from motionserver.core.kinematics.hexapod import leg_lengths, leg_speeds
from motionserver.core.motion.player import Playback, advance, follow, state_now
from motionserver.core.plan import Plan
from motionserver.core.safety.accept import accept_proposal
from motionserver.core.safety.edges import edges, judge_reset
from motionserver.core.safety.fault_return import FaultReturn
from motionserver.core.safety.given import GuardConfig, TickInput
from motionserver.core.safety.own_moves import NEUTRAL, OwnMoves, ends_at_neutral
from motionserver.core.safety.patient import PatientCheck, may_follow
from motionserver.core.safety.record import GuardRecord
from motionserver.core.safety.setpoint import Setpoint
from motionserver.core.safety.states import CUED, LATCHED, RAISED, Event, State
from motionserver.core.safety.supervisor import Supervisor, is_standing
from motionserver.core.safety.verdict import AcceptedPlan, Rejection
from motionserver.core.safety.watchdog import SECOND
from motionserver.core.state import PlatformState

UNHEARD = 1.0
"""Longest time without a setpoint on the wire after which a plan is still continued [s]."""


class Guard:
    """The guard without clock and socket."""

    def __init__(self, config: GuardConfig) -> None:
        self.config = config
        self.machine = config.machine
        self.homes = frozen(np.stack((NEUTRAL, config.machine.parked_pose)))
        self.record = GuardRecord()
        self.supervisor = Supervisor(
            config.machine,
            config.patience,
            config.send_period,
            config.plan_period,
            config.dry_run,
        )
        device = self.supervisor.device
        self.moves = OwnMoves(config.machine, self.record, device, self.homes)
        self.fault_return = FaultReturn(self.record, self.supervisor, self.moves)
        self._sent_before: Array | None = None
        self.judged: Plan | None = None
        """The proposal that was decided about in the last tick."""
        self._patient = (
            PatientCheck(config.machine, self.homes, config.slices) if config.slices else None
        )
        self._before: Playback | None = None
        # the sample at the plan's clock has not been sent yet
        self.owes_sample = self._owed = False
        self._unsent_ns = 0
        self._last = Setpoint(
            Order.WAIT, PlatformState.at_rest(NEUTRAL), leg_lengths(self.machine, NEUTRAL)
        )

    def tick(self, given: TickInput) -> tuple[Setpoint | None, tuple[str, ...]]:
        """Act on one tick.

        Args:
            given: What came in.

        Returns:
            The setpoint to send now, if one is due; one answer per request, empty = granted.
        """
        record, supervisor = self.record, self.supervisor
        if given.leave and not record.leaving:
            record.leaving = True
            if record.state not in RAISED:
                self._allow(self._park_bound(), given.now_ns)
        for feedback in given.feedback:
            supervisor.device.answered(feedback)
        supervisor.heard(given.now_ns, given.cue, given.gap)
        self._judge(given)
        answers, wishes = edges(self.config, record, supervisor, given)
        followed = supervisor.step(record, given.now_ns, given.gap, wishes)
        if followed is not None:
            self._enter(*followed, given.now_ns)
        judge_reset(self.config.patience, record, supervisor, given.now_ns)
        if not given.is_due:
            return None, answers
        return self._send(given.now_ns), answers

    @property
    def reason(self) -> str:
        """Why it is in its state; in a fault also what is done or waited for, for people."""
        record, status = self.record, self.supervisor.return_decision.status
        return "; ".join(filter(None, (record.reason, record.reset_failure, status)))

    @property
    def is_checking(self) -> bool:
        """True while a proposal waits for the next slices of its check."""
        return self._patient is not None and self._patient.is_busy

    def told(self, now_ns: int, is_sent: bool) -> None:
        """Learn what became of the setpoint of this tick.

        One that the network refused has moved nothing: the plan's clock stands still for it, so
        that the next one that goes out continues where the last one ended.

        Args:
            now_ns: Now [ns].
            is_sent: Whether it went out.
        """
        record = self.record
        if is_sent:
            self._unsent_ns = 0
            return
        record.playback, self.owes_sample = self._before, self._owed
        record.sent_legs = self._sent_before
        self.supervisor.excuse_plans(record.accepted_ns, now_ns)
        self._unsent_ns = self._unsent_ns or now_ns
        unheard = (now_ns - self._unsent_ns) / SECOND
        if record.state in RAISED and unheard > self.config.patience.feedback:
            self.supervisor.inconsistent = (
                f"the network takes no setpoint for {unheard * 1e3:.0f} ms: see to the way to the "
                "platform"
            )
        if record.state is State.FAULT and unheard > UNHEARD:
            # by now the device has stopped by itself
            record.playback = None

    def _judge(self, given: TickInput) -> None:
        """Decide about a proposal: at once, or over several ticks where those are short."""
        record, playback, now = self.record, self.record.playback, given.now_ns
        self.judged = given.proposal
        verdict: AcceptedPlan | Rejection | None = None
        if self._patient is not None:
            if given.proposal is not None and self._patient.offer(given.proposal):
                record.counters["plans_overtaken"] += 1
            self.judged, verdict = self._patient.tick(record.state, playback) or (None, None)
        elif given.proposal is not None:
            verdict = may_follow(record.state, playback)
            if verdict is None:
                assert playback is not None
                verdict = accept_proposal(
                    self.machine, given.proposal, playback.newest, playback.newest_clock, self.homes
                )
        if verdict is not None:
            assert self.judged is not None
            record.judged_id = self.judged.plan_id
            record.refusal = verdict.reason if isinstance(verdict, Rejection) else None
        if isinstance(verdict, Rejection):
            record.counters["plans_rejected"] += 1
            record.counters[f"rejected_{verdict.reason}"] += 1
            record.rejections.append((now, verdict))
        elif verdict is not None:
            assert playback is not None
            record.playback = follow(playback, verdict)
            record.accepted_ns = now
            record.counters["plans_accepted"] += 1

    def _enter(self, state: State, event: Event, now_ns: int) -> None:
        record = self.record
        before = record.state
        reason = self.supervisor.why(record, event, now_ns)
        record.note(now_ns, f"{before} -> {state}: {reason}")
        record.counters[f"entered_{state.lower()}"] += 1
        record.state, record.reason, record.since_ns = state, reason, now_ns
        record.reset_until_ns, record.reset_failure = 0, ""
        self.supervisor.return_decision.enter()
        if state is State.RAISING:
            self._own(self.moves.start_at(NEUTRAL, self.homes), now_ns)
            self._allow(self.config.patience.raising, now_ns)
        elif state is State.PARKING:
            if before not in RAISED:
                self._own(self.moves.start_from_measured(), now_ns)
            self._allow(self._park_bound(), now_ns)
        elif state in (State.PARKED, State.OFFLINE, State.SAFE):
            # a device that stopped by itself plays nothing: what follows begins where it stands
            record.playback = record.sent_legs = None
            self.supervisor.device.forgive()
        if state in LATCHED and record.leaving and event is not Event.PARK_TIMEOUT:
            # a service that ends waits so long for it to come down
            self._allow(self._park_bound(), now_ns)

    def _park_bound(self) -> float:
        """Twice the time that all that is played, the way home and settling take [s]."""
        playback, patience = self.record.playback, self.config.patience
        travel = 0.0 if playback is None else playback.remaining + playback.newest.way_home
        waits = patience.sound if self.record.state in LATCHED else 0.0
        return 2.0 * (waits + travel + patience.lowering)

    def _allow(self, seconds: float, now_ns: int) -> None:
        self.record.deadline_ns = now_ns + int(seconds * SECOND)

    def _own(self, refusal: str, now_ns: int) -> None:
        """Note what forbids a plan of the guard's own; empty if nothing does."""
        if refusal:
            self.supervisor.inconsistent = refusal
            self.record.note(now_ns, refusal)

    def _send(self, now_ns: int) -> Setpoint:
        record = self.record
        order = self._order(now_ns)
        self._before, self._sent_before = record.playback, record.sent_legs
        self._owed, self.owes_sample = self.owes_sample, False
        if record.playback is not None and order is Order.FOLLOW and not self._owed:
            ahead = advance(record.playback, self.config.send_period)
            record.playback = self._homeward(ahead, now_ns)
        if record.playback is None:
            state = PlatformState.at_rest(NEUTRAL)
        else:
            state = state_now(record.playback)
        legs, speeds = leg_speeds(self.machine, state.pose[None], state.velocity[None])
        inside = (legs[0] >= self.machine.leg_min) & (legs[0] <= self.machine.leg_max)
        if not bool(inside.all()):
            # cannot happen on an accepted plan: if it does, stand where the platform was last sent
            self.supervisor.inconsistent = "an accepted plan led outside the stroke"
            record.playback = None
            return self._last
        sent = Order.WAIT if self.config.dry_run else order
        setpoint = Setpoint(sent, state, frozen(legs[0]))
        self.fault_return.sent(sent, legs[0])
        if sent is Order.FOLLOW:
            self.supervisor.astray = self.supervisor.device.track(now_ns, legs[0], speeds[0])
        self._last = setpoint
        record.counters["setpoints"] += 1
        return setpoint

    def _order(self, now_ns: int) -> Order:
        record = self.record
        standing = is_standing(record.playback)
        if record.state is State.RAISING:
            return Order.RAISE
        if record.state in CUED:
            return Order.FOLLOW
        if record.state is State.PARKING and record.playback is not None:
            is_home = standing and ends_at_neutral(record.playback)
            return Order.PARK if is_home else Order.FOLLOW
        return self.fault_return.order(now_ns) if record.state in LATCHED else Order.WAIT

    def _homeward(self, playback: Playback, now_ns: int) -> Playback:
        """While parking: once at rest, followed by the straight move to neutral."""
        if self.record.state is not State.PARKING or not playback.is_at_rest:
            return playback
        ahead = self.moves.homeward(playback)
        if isinstance(ahead, str):
            self._own(ahead, now_ns)
            return playback
        return ahead
