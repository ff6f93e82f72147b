"""A guard that was told to leave: how long it tries to bring the platform down, and its status."""

import numpy as np
import pytest
from act_scene import NEUTRAL, SECOND, Scene, at_rest, moving
from guard_scenes import away, in_state, legal
from machines import compact

from motionserver.core.device import Feedback, Order, Phase
from motionserver.core.safety.ending import exit_status, is_down
from motionserver.core.safety.record import GuardRecord
from motionserver.core.safety.states import RAISED, State
from motionserver.core.safety.watchdog import DeviceWatch, Patience

NOW = 100 * SECOND
DOWN = Feedback(NOW, Phase.DOWN, "IDLE")
UP = Feedback(NOW, Phase.UP, "ENGAGED", NEUTRAL)
FAULTED = Feedback(NOW, Phase.FAULTED, "FAULT2", NEUTRAL, faults=("bus",))
HOME = Feedback(NOW, Phase.FAULTED, "FAULT2", NEUTRAL, faults=("bus",), is_home=True)
STOPPED = Feedback(NOW, Phase.FAULTED, "FAULT2", NEUTRAL, faults=("E-stop",), estop=True)


def status(state, newest, playback=None, deadline=NOW + 1, now=NOW, began=0):
    device = DeviceWatch(compact(), Patience(), 1 / 60)
    if newest is not None:
        device.answered(newest)
    record = GuardRecord(state, playback=playback, deadline_ns=deadline)
    return exit_status(record, device, began, now)


@pytest.mark.parametrize("state", sorted(RAISED))
def test_a_raised_platform_is_not_left(state):
    assert status(state, UP, deadline=0) is None


@pytest.mark.parametrize(
    ("state", "newest", "due", "expected"),
    [
        (State.PARKED, DOWN, False, 0),
        # down is down, latched or not
        (State.FAULT, DOWN, False, 0),
        (State.FAULT, HOME, False, 0),
        (State.SAFE, DOWN, False, 0),
        (State.SAFE, HOME, False, 0),
        # up: it is tried for as long as parking may take
        (State.FAULT, UP, False, None),
        (State.FAULT, UP, True, 3),
        (State.FAULT, FAULTED, False, None),
        (State.FAULT, FAULTED, True, 3),
        (State.FAULT, None, False, None),
        (State.FAULT, None, True, 3),
        (State.SAFE, UP, False, None),
        (State.SAFE, UP, True, 3),
        (State.SAFE, None, True, 3),
        # against an open stop nothing is tried
        (State.SAFE, STOPPED, False, 3),
    ],
)
def test_the_status_says_whether_the_platform_is_down(state, newest, due, expected):
    assert status(state, newest, deadline=NOW - 1 if due else NOW) is expected


def test_a_plan_of_a_fault_is_played_to_its_end_whatever_the_time():
    assert status(State.FAULT, DOWN, moving(), deadline=0) is None
    assert status(State.FAULT, UP, at_rest(), deadline=0) == 3


def test_an_old_answer_is_no_proof_that_it_is_down():
    assert status(State.FAULT, DOWN, now=NOW + SECOND, deadline=NOW + 2 * SECOND) is None
    assert status(State.FAULT, DOWN, now=NOW + 3 * SECOND, deadline=NOW + 2 * SECOND) == 3


def test_an_old_answer_of_an_open_stop_does_not_end_the_tries_of_a_fault():
    """The device fell silent with it: it is tried for as long as parking may take."""
    since = NOW + SECOND
    assert status(State.FAULT, STOPPED, now=since, deadline=since) is None
    assert status(State.FAULT, STOPPED, now=since, deadline=since - 1) == 3


@pytest.mark.parametrize(
    ("newest", "due", "expected"),
    [(None, False, 0), (DOWN, False, 0), (UP, False, None), (UP, True, 3), (HOME, False, 0)],
)
def test_who_is_offline_was_never_up_or_is_waited_for(newest, due, expected):
    deadline = NOW if due else NOW + 5 * SECOND
    now = NOW + SECOND + 1
    assert status(State.OFFLINE, newest, deadline=deadline, began=NOW, now=now) is expected
    assert status(State.OFFLINE, newest, deadline=0, began=NOW, now=now - 1) is None


@pytest.mark.parametrize("phase", [Phase.UP, Phase.RAISING, Phase.LOWERING])
def test_a_home_switch_that_has_not_opened_yet_is_not_down(phase):
    assert not is_down(Feedback(NOW, phase, "", is_home=True))
    assert is_down(Feedback(NOW, Phase.DISABLED, "", is_home=True))


def ends(b, seconds=60.0):
    """Tick until the guard would end; its status and how long it took [s]."""
    begin = b.now
    while True:
        found = exit_status(b.record, b.guard.supervisor.device, begin, b.now)
        if found is not None:
            return found, (b.now - begin) * 1e-9
        assert (b.now - begin) * 1e-9 < seconds, b.guard.reason
        b.tick(leave=True)


@pytest.mark.parametrize("seconds", [0.13, 0.15, 0.5])
@pytest.mark.parametrize("first", ["fault", "leave"])
def test_a_service_that_ends_in_a_fault_parks_first(seconds, first):
    b = in_state("RUN")
    if first == "leave":
        b.tick(leave=True)
    b.device.silent = True
    b.run(seconds)
    assert b.state == "FAULT"
    b.device.silent = False
    found, took = ends(b)
    assert (found, b.state) == (0, "FAULT")
    assert b.device.phase is Phase.DOWN
    assert took < 10.0
    legal(b)


def test_a_service_that_ends_beside_a_silent_device_tries_for_the_time_of_parking():
    b = in_state("RUN")
    b.device.silent = True
    b.until("FAULT", 0.3)
    b.run(5.0)
    b.tick(leave=True)
    bound = (b.record.deadline_ns - b.now) * 1e-9
    assert 22.0 < bound < 40.0
    found, took = ends(b)
    assert found == 3
    assert took == pytest.approx(bound, abs=0.05)


def test_a_park_that_took_too_long_is_not_tried_again_by_a_service_that_ends():
    b = in_state("RUN")
    b.device.take = lambda setpoint: None
    b.device.mute = True
    b.tick(leave=True)
    b.until("FAULT", 60.0)
    assert "parking took" in b.record.reason
    assert ends(b, 5.0)[0] == 3


def stopped(leave=False):
    b = in_state("RUN")
    away(b, (0.03, 0.0, 0.02, 0.0, 0.0, 0.0))
    b.tick(leave=leave)
    b.device.estop = True
    b.until("SAFE", 0.1)
    b.run(1.0)
    return b


def test_a_service_that_ends_fights_no_stop():
    b = stopped()
    found, took = ends(b)
    assert (found, took) == (3, 0.0) or took < 0.01
    assert set(s.order for s in b.sent[-60:]) == {Order.WAIT}


def test_a_service_that_ends_brings_down_what_a_closed_stop_has_left_up():
    b = stopped()
    b.device.estop = False
    b.run(3.0)
    assert b.sent[-1].order is Order.WAIT
    where = np.array(b.device.legs)
    frames = len(b.sent)
    found, _ = ends(b)
    assert (found, b.state) == (0, "SAFE")
    first = next(s for s in b.sent[frames:] if s.order is Order.FOLLOW)
    assert first.legs == pytest.approx(where, abs=1e-3)
    assert [s.order for s in b.sent[-3:]][-1] is not Order.FOLLOW
    legal(b)


def test_a_stop_that_opens_again_is_followed_at_once_by_a_service_that_ends():
    b = stopped()
    b.device.estop = False
    while b.sent[-1].order is not Order.FOLLOW:
        b.tick(leave=True)
    b.run(0.2)
    b.device.estop = True
    b.run(0.02)
    frames = len(b.sent)
    b.run(0.5)
    assert {s.order for s in b.sent[frames:]} == {Order.WAIT}
    assert b.record.playback is None


def test_who_is_told_to_leave_in_a_fault_has_the_time_that_parking_may_take():
    scene = Scene(State.FAULT, playback=at_rest())
    scene.answers = False
    scene.tick(leave=True)
    way = at_rest().newest.way_home
    assert scene.record.deadline_ns == scene.now + int(2.0 * (1.0 + way + 10.0) * SECOND)
    before = scene.record.deadline_ns
    scene.tick(leave=True)
    assert scene.record.deadline_ns == before
