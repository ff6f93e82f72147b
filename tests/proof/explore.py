"""Breadth-first over everything that can happen to the coarse guard, and what must hold in it."""

import itertools
from collections import Counter, deque
from typing import NamedTuple

import numpy as np
from coarse_guard import Given, Node

from motionserver.core.device import Order, Phase
from motionserver.core.safety.states import CUED, RAISED, State
from motionserver.core.safety.supervisor import is_standing

LATCHED = (State.FAULT, State.SAFE)
UP, DOWN = "up told", "down low"
DEVICE = (
    "silent",
    DOWN,
    UP,
    "up elsewhere",
    "up absurd",
    "lowering told",
    "up told fault",
    "up told fault estop",
    "up told estop",
    "disabled told",
    "down low fault",
    "down low estop",
)
SOME = (*DEVICE[:7], "up told estop")
UPSTREAM = (
    ("none", "none"),
    ("none", "moves"),
    ("drive", "none"),
    ("drive", "moves"),
    ("drive", "stays"),
    ("drive", "nonsense"),
    ("pause", "moves"),
    ("bye", "moves"),
)
PAIRS = (
    ("none", "none"),
    ("drive", "moves"),
    ("drive", "none"),
    ("pause", "moves"),
    ("bye", "moves"),
)
OPERATOR = (
    ("none", 1),
    ("engage", 1),
    ("park", 1),
    ("reset", 1),
    ("leave", 1),
    ("none", 2),
    ("none", 3),
)


class Step(NamedTuple):
    """One transition: what was, what happened, what is."""

    before: Node
    given: Given
    after: Node
    setpoint: object
    answers: tuple
    had: bool
    """An operator had asked to reset."""
    playback: object
    """What is played."""


class Explorer:
    """Finds every state; ``hold`` looks at every transition."""

    def __init__(self, coarse, hold, most=1_000_000):
        self.coarse, self.hold, self.most = coarse, hold, most
        self.found = {}
        self.transitions = 0
        self.edges = Counter()

    def step(self, node, given):
        coarse = self.coarse
        setpoint, answers = coarse.tick(node, given)
        coarse.last_order = setpoint.order
        record = coarse.guard.record
        before, after = node.record[0], record.state
        granted = given.operator == "reset" and answers == ("",)
        asked = (node.asked or granted) if after is before else False
        engaged = after is State.RAISING or (node.engaged and after in CUED)
        if before is State.PARKED and after is State.RAISING:
            engaged = given.operator == "engage" or node.record[7] is not record.engaged_once
        playback = record.playback
        step = Step(
            node,
            given,
            coarse.node(node.now + given.gap * 1_000_000_000, engaged, asked),
            setpoint,
            answers,
            node.asked or granted,
            playback,
        )
        self.transitions += 1
        if before is not after:
            self.edges[before.value, after.value] += 1
        self.hold(coarse, step)
        return step.after

    def explore(self, start, choices):
        """Every node that can be reached when in each tick any of ``choices(node)`` happens."""
        sign = self.coarse.sign
        todo = deque([start])
        self.found[sign(start)] = start
        while todo:
            node = todo.popleft()
            for given in choices(node):
                after = self.step(node, given)
                key = sign(after)
                if key not in self.found:
                    assert len(self.found) < self.most, "more states than there should be"
                    self.found[key] = after
                    todo.append(after)
        return self


def hostile(node):
    """Whatever the device may do, and beside it source and planner, an operator, or a gap."""
    state = node.record[0]
    for device in SOME:
        for source, planner in PAIRS[:3] if state in RAISED else PAIRS[:2]:
            yield Given(device, source, planner)
        if state in LATCHED:
            yield Given(device, "drive", "moves", "reset")
        elif state in RAISED:
            yield Given(device, "drive", "moves", "park")
        if state in CUED and device in (UP, "silent"):
            for gap in (2, 3):
                yield Given(device, "drive", "moves", "none", gap)
    for device, operator in itertools.product((UP, DOWN), ("engage", "park", "reset")):
        yield Given(device, "drive", "moves", operator)
    if state is State.PARKED:
        for device, (source, planner) in itertools.product(SOME, PAIRS[:3]):
            yield Given(device, source, planner, "engage")


def everything(node):
    """Whatever device, source, planner and operator may do, all of it at once."""
    for device, (source, planner), (operator, gap) in itertools.product(DEVICE, UPSTREAM, OPERATOR):
        yield Given(device, source, planner, operator, gap)


class Broken(AssertionError):  # noqa: N818
    """A rule does not hold."""


def rules(coarse, step):
    """What must hold in every tick, whatever happens."""
    before, after = State(step.before.record[0]), State(step.after.record[0])
    newest = step.after.device[0]
    playback = step.playback
    setpoint, given = step.setpoint, step.given
    order = setpoint.order
    entered = after is not before

    def rule(holds, text):
        if not holds:
            raise Broken(f"{text}: {before} -> {after}, {given}, {order}")

    # to move is to play what was accepted
    if order is Order.FOLLOW:
        rule(playback is not None, "follows without a plan")
        rule(id(playback.playing) in coarse.accepted, "plays what was never accepted")
        told = playback.playing.plan.state(playback.clock)
        rule(np.array_equal(told.pose, setpoint.state.pose), "sends what it does not play")
        rule(after in RAISED or after is State.FAULT, "follows while it must not move")
    else:
        rule(not np.any(setpoint.state.velocity) or after in LATCHED, "moves without an order")
    rule(order is not Order.RAISE or after is State.RAISING, "lifts without being raised")
    rule(order is not Order.RESET or (after in LATCHED and step.had), "resets by itself")
    rule(order is not Order.PARK or after in (State.PARKING, State.FAULT), "settles by itself")
    rule(after not in CUED or playback is not None, "is cued without a plan")
    # latched until an operator asks
    if before in LATCHED and entered and after is not State.SAFE:
        rule(step.had, "left by itself")
        rule(is_standing(step.before.record[2]), "left in motion")
        rule(after not in CUED and after is not State.RAISING, "left upwards")
    # the way home in a fault begins after the device has answered without fault for long enough
    if before in LATCHED and after is State.FAULT and is_standing(step.before.record[2]) and newest:
        starts = order is Order.FOLLOW or (order is Order.PARK and not newest.faults)
        starts = starts and newest.phase is not Phase.DISABLED
        sound = step.after.device[7]
        rule(
            not starts or (sound is not None and step.after.now - sound >= 1_000_000_000),
            "comes down too soon",
        )
        lost = step.after.now - newest.arrival_ns > 3_000_000_000
        rule(not starts or not lost or _excused(step), "comes down beside a silent device")
    # up by an operator only
    if after is State.RAISING and entered:
        rule(before is State.PARKED and given.operator == "engage", "raised by itself")
        rule(given.source != "none" and newest.phase is Phase.DOWN, "raised without source or base")
        rule(not step.after.record[6], "raised while it ends")
    rule(after not in CUED or step.after.engaged, "cued but never engaged")
    rule(after is not State.RUN or before in (State.READY, State.HOLD, State.RUN), "ran from afar")
    if after is State.RUN:
        rule(given.source == "drive", "runs without a source")
        rule(given.gap < 3 or entered, "runs on over a gap")
    if after is State.RUN and entered:
        rule(_planned(step), "runs without plans")
    # downstream trouble stops
    if newest is not None and newest.estop and given.device != "silent":
        rule(after is State.SAFE, "an open stop is not followed")
        rule(order in (Order.WAIT, Order.RESET), "moves against the stop")
    if given.device != "silent" and (newest.faults or newest.phase is Phase.DISABLED):
        rule(after in LATCHED, "a fault of the device is ignored")
    if given.device != "silent" and after in CUED:
        rule(newest.phase is Phase.UP, "cues a base that is not up")
    lost = newest is None or step.after.now - newest.arrival_ns > 3_000_000_000
    if lost and not _excused(step):
        rule(after not in RAISED and after is not State.PARKED, "a silent device is ignored")
    # trouble upstream does not fault; only a stop is SAFE
    if after is State.SAFE and entered:
        rule(newest.estop, "safe without a stop")
    if given.operator in ("park", "leave") and before in RAISED:
        rule(after not in CUED and after is not State.RAISING, "park is refused")
    if after is State.PARKED:
        rule(not entered or newest.phase is Phase.DOWN, "parked while up")
        rule(order is Order.WAIT and playback is None, "parked but not still")
    if after in (State.OFFLINE, State.SAFE):
        rule(playback is None and order in (Order.WAIT, Order.RESET), "moves where it must not")


def _planned(step):
    """A plan was accepted within the planner's patience, or it is excused for a gap."""
    now, accepted = step.after.now, step.after.record[4]
    excused_of, resumed = step.after.supervisor[3]
    return now - (resumed if excused_of == accepted else accepted) <= 1_000_000_000


def _excused(step):
    newest, _, _, excused, at, *_ = step.after.device
    return newest is not None and excused is newest and step.after.now - at <= 3_000_000_000
