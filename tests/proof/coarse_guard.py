"""The guard's own functions on a clock of whole seconds, so that its states can be counted.

Nothing of `core.safety` is copied: `Guard.tick` runs, with patience scaled to few ticks. What it
computes of plans is pure and remembered here, and two plans that would be played alike from now
on are one.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from machines import compact

from motionserver.core.axes import frozen
from motionserver.core.device import Feedback, Phase
from motionserver.core.kinematics.hexapod import leg_lengths
from motionserver.core.limits import Pace
from motionserver.core.motion.moves import rest_to_rest
from motionserver.core.safety import act
from motionserver.core.safety import own_moves as own
from motionserver.core.safety.given import GuardConfig, Request, TickInput
from motionserver.core.safety.states import CUED, RAISED, State
from motionserver.core.safety.verdict import AcceptedPlan
from motionserver.core.safety.watchdog import CueStatus, Patience
from motionserver.core.state import DriveMode
from motionserver.cueing.governor import remainder

SECOND = 1_000_000_000
SEND = 0.5
START = 1000 * SECOND
AWAY = np.array([0.02, 0.0, 0.0, 0.0, 0.0, 0.0])
ELSEWHERE = np.array([-0.03, 0.0, 0.02, 0.0, 0.0, 0.0])


def patience(lowering, raising):
    return Patience(
        valid=1.0,
        feedback=0.1,
        fresh=1.0,
        plans=2,
        hold=1.0,
        pause=2.0,
        silence=1.0,
        raising=raising,
        lowering=lowering,
        gap=2.0,
        reset=1.5,
        track_time=0.5,
        spared=1.0,
    )


class Given(NamedTuple):
    """What happens in one tick, in words."""

    device: str
    source: str = "none"
    planner: str = "none"
    operator: str = "none"
    gap: int = 1


class Node(NamedTuple):
    """Everything a guard remembers between two ticks, and two things that the tests remember."""

    now: int
    record: tuple
    supervisor: tuple
    decision: tuple
    source: tuple
    device: tuple
    last: object
    engaged: bool
    asked: bool


_RECORD = (
    "state",
    "since_ns",
    "playback",
    "deadline_ns",
    "accepted_ns",
    "reset_until_ns",
    "leaving",
    "engaged_once",
    "sent_legs",
)
_DECISION = ("_since", "_settles", "_seen_ns", "_phase", "status", "is_blocked")
_SUPERVISOR = (
    *("inconsistent", "astray", "_paused_ns", "_excused"),
    *("_hold_ns", "_spared_ns", "_looked_ns", "_was_held"),
)
_SOURCE = ("status", "_driving_since", "_silent_since")
_DEVICE = (
    *("newest", "_valid_since", "_astray_since", "_excused", "_excused_ns"),
    *("_still_at", "_still_since", "_sound_since"),
)


class CoarseGuard:
    """One guard that is put into any state it was found in, and ticked."""

    def __init__(self, monkeypatch, lowering=0.5, raising=1.0, **config):
        machine = replace(compact(), pace=Pace(0.6, 8.0, 200.0))
        self.machine = machine
        self.accepted = {}
        self.last_order = None
        self._memory = {}
        self._alike = {}
        self._signs = {}
        self._offers = {}
        self._remember(monkeypatch)
        self.guard = act.Guard(
            GuardConfig(machine, SEND, 0.5, patience=patience(lowering, raising), **config)
        )
        self.low = frozen(leg_lengths(machine, machine.parked_pose) - 0.01)
        self.places = {
            "low": self.low,
            "elsewhere": frozen(leg_lengths(machine, ELSEWHERE)),
            "absurd": frozen(np.full(6, 1.19)),
        }
        self.first = self.node(START, False, False)

    def _remember(self, monkeypatch):
        def known(name, key_of, room=act):
            whole = getattr(room, name)

            def remembered(*given):
                key = (name, *key_of(*given))
                if key not in self._memory:
                    # what is given stays alive with the answer, so that no id is used twice
                    self._memory[key] = (whole(*given), given)
                answer = self._memory[key][0]
                if isinstance(answer, AcceptedPlan):
                    self.accepted[id(answer)] = answer
                return answer

            monkeypatch.setattr(room, name, remembered)

        known("accept_rest", lambda m, pose, number, homes, reach: (pose.tobytes(), reach), own)
        known(
            "accept_move",
            lambda m, parent, at, goal, number, homes: (id(parent), at, goal.tobytes()),
            own,
        )
        known(
            "accept_proposal", lambda m, plan, parent, clock, homes: (id(plan), id(parent), clock)
        )
        known("forward", lambda m, legs: (legs.tobytes(),), own)
        known("leg_speeds", lambda m, *state: tuple(map(bytes, state)))
        known("state_now", lambda playback: (id(playback.playing), playback.clock))

    def node(self, now, engaged, asked):
        """What the guard remembers now."""
        guard, supervisor = self.guard, self.guard.supervisor
        record = guard.record
        if record.playback is not None:
            record.playback = self._alike.setdefault(self.played(record.playback), record.playback)
        return Node(
            now,
            tuple(getattr(record, name) for name in _RECORD),
            tuple(getattr(supervisor, name) for name in _SUPERVISOR),
            tuple(getattr(supervisor.return_decision, name) for name in _DECISION),
            tuple(getattr(supervisor.source, name) for name in _SOURCE),
            tuple(getattr(supervisor.device, name) for name in _DEVICE),
            guard._last,
            engaged,
            asked,
        )

    def put(self, node):
        """Make the guard remember this."""
        guard, supervisor = self.guard, self.guard.supervisor
        for what, names, values in (
            (guard.record, _RECORD, node.record),
            (supervisor, _SUPERVISOR, node.supervisor),
            (supervisor.return_decision, _DECISION, node.decision),
            (supervisor.source, _SOURCE, node.source),
            (supervisor.device, _DEVICE, node.device),
        ):
            for name, value in zip(names, values, strict=True):
                setattr(what, name, value)
        guard._last = node.last
        for kept in (guard.record.events, guard.record.rejections):
            kept.clear()

    def tick(self, node, given):
        """One tick of the real guard; the setpoint and the answers to the operator."""
        self.put(node)
        now = node.now + given.gap * SECOND
        feedback = self._feedback(given.device, now)
        operator = given.operator
        cue = None
        if given.source != "none":
            cue = CueStatus(now, SECOND // 10, DriveMode[given.source.upper()])
        return self.guard.tick(
            TickInput(
                now,
                float(given.gap),
                True,
                () if feedback is None else (feedback,),
                cue,
                self._proposal(given.planner),
                (Request(operator, "console"),) if operator in ("engage", "park", "reset") else (),
                operator == "leave",
            )
        )

    def _feedback(self, word, now):
        """An answer in words: phase, where, and what is wrong; "silent" is none."""
        if word == "silent":
            return None
        phase, place, *wrong = word.split()
        legs = self.guard._last.legs if place == "told" else self.places[place]
        faults = ("drive bus",) if "fault" in wrong else ()
        return Feedback(now, Phase(phase), phase, legs.reshape(6), None, faults, "estop" in wrong)

    def _proposal(self, word):
        playback = self.guard.record.playback
        # "moves" lets a move end before it offers the next one
        if word == "none" or playback is None or (word == "moves" and not playback.is_at_rest):
            return None
        key = (id(playback), word)
        if key not in self._offers:
            self._offers[key] = (self._offer(playback, word), playback)
        return self._offers[key][0]

    def _offer(self, playback, word):
        newest, number = playback.newest.plan, len(self._offers) + 1
        takeover = max(playback.newest_clock, 0.0) + SEND / 2
        if word == "moves":
            goal = np.zeros(6) if np.any(newest.rest_pose) else AWAY
            plan = rest_to_rest(number, newest.plan_id, takeover, newest.rest_pose, goal, 0.6)
        else:
            plan = remainder(newest, takeover, number)
        return replace(plan, parent_id=number + 77) if word == "nonsense" else plan

    def played(self, playback):
        """What will be played from now on if nothing is accepted any more."""
        key = (id(playback.playing), playback.clock, tuple(map(id, playback.pending)))
        if key not in self._signs:
            poses, ahead = [], playback
            while True:
                poses.append(tuple(np.round(act.state_now(ahead).pose, 7)))
                if ahead.is_at_rest:
                    break
                ahead = act.advance(ahead, SEND / 2)
            self._signs[key] = (tuple(poses), len(playback.pending), self._age(playback)), playback
        return self._signs[key][0]

    def _age(self, playback):
        # a plan may not be continued within its first instants
        return playback.playing.before is not None and playback.clock < SEND

    def sign(self, node):
        """What tells this node from others: ages in ticks, and only where they are read."""
        state, since, playback, deadline, accepted, reset, leaving, engaged_once, sent = node.record
        inconsistent, astray, paused, (excused_of, resumed), hold, spared, _, was_held = (
            node.supervisor
        )
        status, driving, silent = node.source
        newest, valid, off, excused, excused_ns, still_at, still_since, sound = node.device
        now = node.now
        timed = state in (State.RAISING, State.PARKING)
        latched = state in (State.FAULT, State.SAFE)
        followed = state in RAISED or (playback is not None and not playback.is_at_rest)
        answer = None
        if newest is not None:
            lost = now - newest.arrival_ns > 3 * SECOND
            answer = (
                newest.phase,
                bool(newest.faults),
                newest.estop,
                _place(newest, node.last) if newest.phase is Phase.UP else None,
                _age(now, newest.arrival_ns, 4),
                0 if lost else _age(now, valid, 1),
                _age(now, excused_ns, 4) if excused is newest else None,
                None if still_at is None else tuple(np.round(still_at, 4)),
                _age(now, still_since, 1),
            )
        upstream = None
        if state in CUED or state is State.RAISING:
            # elsewhere nothing of this is read; until it is, all of it has run out or begun anew
            fresh = not status.is_stale(now)
            upstream = (
                _age(now, resumed if excused_of == accepted else accepted, 2),
                status.mode if fresh else None,
                _age(now, driving, 1) if fresh else None,
                _age(now, silent, 2),
            )
        counts = max(since, paused)
        spared = spared if hold == counts else 0
        held = (
            _age(now, since, 3),
            _age(now, counts + spared, 2),
            spared,
            was_held and hold == counts,
        )
        returns = None
        if latched:
            waits, settles, seen, phase, _, is_blocked = node.decision
            unseen = now - seen > 2 * SECOND
            returns = (
                None if unseen else _age(now, waits, 1),
                _age(now, sound, 1),
                (settles, phase, is_blocked),
                None if sent is None else tuple(np.round(sent, 4)),
            )
        return (
            state,
            held if state is State.HOLD else None,
            None if playback is None else self.played(playback),
            max(-1, (deadline - now) // SECOND) if timed else 0,
            upstream,
            excused_of == accepted,
            max(0, reset - now) if latched else 0,
            returns,
            leaving,
            engaged_once,
            bool(inconsistent),
            astray,
            answer,
            _age(now, off, 1) if followed else None,
            node.engaged,
            node.asked,
        )


def _place(newest, last):
    # measured, solved for a pose and played again, a leg is a hair different each time
    if np.abs(newest.legs - last.legs).max() < 1e-6:
        return "told"
    return tuple(np.round(newest.legs, 5))


def _age(now, then, most):
    """Ticks since then; beyond ``most`` every patience has run out, and ages are alike."""
    return None if then is None else min(most, (now - then) // SECOND)
