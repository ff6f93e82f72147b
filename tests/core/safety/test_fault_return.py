"""A fault does not leave people up: it stays latched, and the platform comes down by itself."""

import itertools
import random
from dataclasses import replace

import numpy as np
import pytest
from device_model import Bench
from guard_scenes import away, die, in_state, legal
from machines import compact
from own_kinematics import lengths

from motionserver.core.device import Order, Phase
from motionserver.core.state import DriveMode

LATCHED_WORDS = "a reset makes it ready again"


def faulted(state="RUN", seconds=0.15):
    """A fault because the device's answers are missing for so long, in a drive."""
    b = in_state(state)
    b.device.silent = True
    b.run(seconds)
    assert b.state == "FAULT", b.record.reason
    b.device.silent = False
    return b


def orders(b, since=0):
    """The orders that were sent, runs of one as one."""
    return [order for order, _ in itertools.groupby(s.order for s in b.sent[since:])]


def comes_down(b, seconds=20.0):
    """It is down by itself and still latched; how long that took [s]."""
    begin = b.now
    while b.device.phase is not Phase.DOWN:
        assert (b.now - begin) * 1e-9 < seconds, (b.guard.reason, orders(b)[-4:])
        assert b.state == "FAULT"
        b.tick()
    b.run(0.1)
    assert b.state == "FAULT"
    assert b.sent[-1].order is Order.WAIT
    assert b.record.playback is None
    assert LATCHED_WORDS in b.guard.reason
    legal(b)
    jumps_nowhere(b)
    return (b.now - begin) * 1e-9


def jumps_nowhere(b):
    """No FOLLOW is further from the one before, or from where the device stood, than a packet."""
    sent = b.sent
    for before, after in itertools.pairwise(sent):
        if before.order is after.order is Order.FOLLOW:
            assert np.abs(after.legs - before.legs).max() < 0.6 / 60 + 1e-6


def goes_on_to_be_latched(b):
    """Nothing raises or cues it but an operator's reset, and then an engage."""
    assert "FAULT" in b.tick("engage", by="console")[0]
    b.run(3.0)
    assert b.state == "FAULT"
    assert b.tick("reset") == ("",)
    b.until("PARKED", 1.0)


@pytest.mark.parametrize("state", ["RAISING", "READY", "RUN", "HOLD", "PARKING"])
@pytest.mark.parametrize("seconds", [0.13, 0.15, 1.5])
def test_answers_that_were_missing_for_a_moment_are_a_fault_that_parks_by_itself(state, seconds):
    b = faulted(state, seconds)
    comes_down(b)
    assert orders(b)[-3:] == [Order.WAIT, Order.PARK, Order.WAIT]
    goes_on_to_be_latched(b)


def test_it_waits_at_rest_for_a_second_without_a_break_before_it_moves():
    b = in_state("RUN")
    away(b, (0.05, 0.02, -0.04, 0.05, 0.04, -0.06), 2.0)
    rest = np.array(b.device.legs)
    b.device.silent = True
    b.until("FAULT", 0.3)
    b.run(2.0)
    b.device.silent = False
    came, frames = b.now, len(b.sent)
    while b.sent[-1].order is not Order.FOLLOW:
        b.tick()
        assert (b.now - came) * 1e-9 < 1.2
    waited = (b.now - came) * 1e-9
    assert 1.0 <= waited <= 1.1
    assert set(orders(b, frames)) == {Order.WAIT, Order.FOLLOW}
    assert np.abs(b.sent[-1].legs - rest).max() < 1e-3, "it begins where it stands"
    comes_down(b)


@pytest.mark.parametrize("gap", [0.12, 0.5])
def test_a_break_makes_it_wait_anew(gap):
    b = faulted()
    while b.record.playback is not None and not b.record.playback.is_at_rest:
        b.tick()
    b.run(0.9)
    b.device.silent = True
    b.run(gap)
    b.device.silent = False
    came = b.now
    while b.sent[-1].order not in (Order.FOLLOW, Order.PARK):
        b.tick()
    assert (b.now - came) * 1e-9 >= 0.98
    comes_down(b)


def test_a_break_on_the_way_home_plays_to_rest_and_waits_again():
    b = faulted()
    while not (b.sent[-1].order is Order.FOLLOW and "way home" in b.guard.reason):
        b.tick()
    b.run(0.2)
    b.device.silent = True
    frames = len(b.sent)
    b.run(8.0)
    assert orders(b, frames) == [Order.FOLLOW, Order.WAIT]
    assert np.abs(b.sent[-1].legs - b.device.neutral).max() < 1e-9
    b.device.silent = False
    came = b.now
    frames = len(b.sent)
    comes_down(b)
    assert orders(b, frames) == [Order.WAIT, Order.PARK, Order.WAIT]
    assert (b.now - came) * 1e-9 > 1.0


def test_a_device_that_reports_a_fault_is_told_to_park_as_long_as_it_does():
    b = in_state("RUN")
    b.device.faults = b.device.held_faults = ("drive bus",)
    b.until("FAULT", 0.1)
    while not (b.record.playback is None or b.record.playback.is_at_rest):
        b.tick()
        assert b.sent[-1].order is Order.FOLLOW
    b.run(0.05)
    frames = len(b.sent)
    b.run(3.0)
    assert orders(b, frames) == [Order.PARK]
    assert b.device.phase is Phase.DOWN
    assert b.state == "FAULT"


@pytest.mark.parametrize("phase", [Phase.FAULTED, Phase.DISABLED])
def test_a_device_that_says_no_more_than_that_it_is_faulty_is_told_to_park(phase):
    b = in_state("RUN")
    b.device.phase = phase
    b.until("FAULT", 0.1)
    b.run(5.0)
    assert b.sent[-1].order is Order.PARK
    assert phase.name in b.guard.reason


def test_a_platform_that_stands_elsewhere_is_not_moved_and_it_is_said():
    b = in_state("READY")
    b.until("READY", 1.0)
    b.mode = DriveMode.DRIVE
    b.until("RUN", 1.0)
    b.device.stuck = True
    away(b)
    b.run(10.0)
    assert b.state == "FAULT"
    frames = len(b.sent)
    b.run(10.0)
    assert orders(b, frames) == [Order.WAIT]
    assert "mm from where it was sent" in b.guard.reason
    refusal = b.tick("park")[0]
    assert "mm from where it was sent" in refusal
    assert "reset" in refusal
    # freed, it goes where it was sent, and from there home
    b.device.stuck = False
    b.device.legs = b.sent[-1].legs
    comes_down(b)


def test_where_it_stands_is_assumed_where_the_device_measures_nothing():
    b = Bench(compact())
    b.device.mute = True
    b.engaged()
    away(b)
    b.device.silent = True
    b.until("FAULT", 0.3)
    b.device.silent = False
    while b.sent[-1].order is not Order.PARK:
        b.tick()
    assert any("not measured, and assumed where sent" in text for _, text in b.record.events)
    comes_down(b)


def test_a_fault_before_anything_was_played_begins_where_the_platform_is_measured():
    b = Bench(compact())
    b.device.put_up(np.array([0.03, 0.02, -0.02, 0.0, 0.05, 0.0]))
    place = np.array(b.device.legs)
    take, b.device.take = b.device.take, lambda setpoint: None
    b.device.faults = ("watchdog",)
    b.until("FAULT", 0.1)
    b.run(0.3)
    # it has not obeyed, and the fault is gone
    b.device.faults = ()
    b.run(0.05)
    b.device.take = take
    frames = len(b.sent)
    b.run(1.2)
    first = next(s for s in b.sent[frames:] if s.order is Order.FOLLOW)
    assert first.legs == pytest.approx(place, abs=1e-3)
    comes_down(b)


def test_an_open_stop_is_followed_on_the_way_home():
    b = faulted()
    while not (b.sent[-1].order is Order.FOLLOW and "way home" in b.guard.reason):
        b.tick()
    b.device.estop = True
    b.until("SAFE", 0.1)
    frames = len(b.sent)
    b.run(3.0)
    assert orders(b, frames + 1) == [Order.WAIT]
    b.device.estop = False
    b.run(5.0)
    assert b.state == "SAFE"
    assert b.sent[-1].order is Order.WAIT
    assert "reset" in b.tick("park")[0]


def test_no_plan_of_the_planner_is_taken_in_a_fault_however_it_goes_home():
    b = faulted()
    accepted = b.record.counters["plans_accepted"]
    comes_down(b)
    assert b.record.counters["plans_accepted"] == accepted
    assert b.record.counters["rejected_not-cueing"] > 10


def test_a_request_to_park_in_a_fault_is_granted_where_it_parks_and_refused_where_not():
    b = faulted()
    assert b.tick("park") == ("",)
    b.device.silent = True
    b.run(6.0)
    assert "does not answer" in b.tick("park")[0]
    b.device.silent = False
    b.run(0.3)
    assert b.tick("park") == ("",)
    comes_down(b)
    assert b.tick("park") == ("",)


def test_a_request_to_park_while_the_device_is_silent_is_refused_with_the_reason():
    b = Bench(compact())
    b.device.silent = True
    b.run(1.0)
    assert b.state == "OFFLINE"
    assert b.tick("park") == ("the device does not answer; it is parked as soon as it answers",)


@pytest.mark.parametrize("gap", [0.0, 0.4])
@pytest.mark.parametrize("when", ["at rest", "on the way", "settling"])
def test_a_guard_that_takes_over_in_a_fault_brings_it_down_as_well(gap, when):
    b = faulted()
    signs = {"at rest": "once the device", "on the way": "way home", "settling": "being parked"}
    while signs[when] not in b.guard.reason:
        b.tick()
    b.run(0.1)
    assert die(b, gap)
    assert b.state == "FAULT"
    comes_down(b)


def test_a_guard_that_takes_over_does_not_move_what_does_not_follow():
    b = in_state("RUN")
    b.device.stuck = True
    away(b, (-0.05, 0.0, 0.02, 0.0, 0.0, 0.0))
    assert b.state == "FAULT"
    for gap in (0.0, 0.4):
        assert die(b, gap)
        frames = len(b.sent)
        b.run(8.0)
        assert Order.FOLLOW not in orders(b, frames + 5)
        assert b.state == "FAULT"


@pytest.mark.parametrize("seconds", [0.4, 2.0])
def test_a_network_that_refused_for_a_while_is_come_home_from(seconds):
    b = in_state("RUN")
    away(b)
    b.tick("park")
    b.run(0.5)
    b.device.unreachable = True
    b.run(seconds)
    assert b.state == "FAULT"
    b.device.unreachable = False
    comes_down(b)


def test_a_device_that_was_rebooted_is_not_moved_and_comes_down_by_itself():
    b = in_state("RUN")
    b.device.phase = Phase.STARTING
    b.until("FAULT", 0.1)
    b.run(6.0)
    frames = len(b.sent)
    b.run(3.0)
    assert orders(b, frames) == [Order.WAIT]
    assert "STARTING" in b.guard.reason
    b.device.phase, b.device.legs = Phase.DOWN, b.device.low
    b.run(0.1)
    assert b.record.playback is None
    goes_on_to_be_latched(b)


def test_a_device_that_settles_by_itself_is_agreed_with():
    b = in_state("READY")
    b.device.phase = Phase.LOWERING
    b.device._frames = 600
    b.until("FAULT", 0.1)
    b.run(0.9)
    assert b.sent[-1].order is Order.WAIT
    b.run(1.0)
    assert b.sent[-1].order is Order.PARK


def test_a_way_home_that_is_forbidden_is_tried_again_every_second_and_told_once():
    b = in_state("RUN")
    whole = b.guard.moves.machine
    b.device.silent = True
    b.until("FAULT", 0.3)
    b.guard.moves.machine = replace(whole, pace=replace(whole.pace, speed=1e-4))
    b.device.silent = False
    b.run(12.0)
    assert b.state == "FAULT"
    assert "no way home" in b.guard.reason
    assert "no way home" in b.tick("park")[0]
    assert sum("no way home" in text for _, text in b.record.events) == 1
    b.guard.moves.machine = whole
    comes_down(b)


@pytest.mark.parametrize("seed", range(12))
def test_whatever_the_device_answers_nothing_jumps(seed):
    """Late answers, odd ones, faults that come and go; in the end it is down and latched."""
    rng = random.Random(seed)
    b = faulted(rng.choice(["RUN", "HOLD", "PARKING", "READY"]), rng.uniform(0.13, 0.6))
    whole = b.device.answer

    def odd(now):
        answer = whole(now)
        kind = rng.random()
        if kind < 0.02:
            return replace(answer, faults=("odd",))
        if kind < 0.03:
            return replace(answer, phase=rng.choice(list(Phase)))
        if kind < 0.04 and answer.legs is not None:
            return replace(answer, legs=answer.legs + rng.uniform(-0.3, 0.3))
        return answer

    b.device.answer = odd
    for _ in range(40):
        b.device.silent = rng.random() < 0.2
        b.run(rng.uniform(0.05, 0.5))
        if b.state != "FAULT":
            break
    b.device.silent, b.device.answer = False, whole
    if b.state == "FAULT":
        comes_down(b, 40.0)
    for k, setpoint in enumerate(b.sent[1:], 1):
        if setpoint.order is Order.FOLLOW and b.sent[k - 1].order is not Order.FOLLOW:
            assert not np.any(np.abs(setpoint.state.velocity) > 0.02), "it begins at rest"
    jumps_nowhere(b)


def test_the_first_step_home_is_within_a_hair_of_where_it_stood():
    b = faulted()
    while not (b.sent[-1].order is Order.FOLLOW and "way home" in b.guard.reason):
        b.tick()
    assert np.abs(b.sent[-1].legs - b.sent[-2].legs).max() < 1e-3
    assert lengths(b.machine, b.sent[-1].state.pose)[0] == pytest.approx(b.sent[-1].legs)


def test_a_device_that_measures_nothing_and_was_sent_nowhere_is_not_moved():
    b = Bench(compact())
    b.device.mute = True
    b.device.put_up(np.zeros(6))
    b.until("FAULT", 1.0)
    b.run(3.0)
    assert orders(b) == [Order.WAIT]
    assert "cannot go home by itself: the device measures neither legs nor pose" in b.guard.reason
    assert sum("cannot go home" in text for _, text in b.record.events) == 1


def test_a_device_that_still_moves_where_nothing_was_played_is_waited_for():
    b = Bench(compact())
    b.device.put_up(np.array([0.03, 0.0, 0.02, 0.0, 0.0, 0.0]))
    take, b.device.take = b.device.take, lambda setpoint: None
    b.device.faults = ("watchdog",)
    b.until("FAULT", 0.1)
    b.device.faults = ()
    b.run(0.05)
    b.device.take = take
    begin, frames = np.array(b.device.legs), len(b.sent)
    for k in range(480):
        b.device.legs = begin + 0.01 * np.sin(0.1 * k)
        b.tick()
    assert orders(b, frames) == [Order.WAIT]
    b.device.legs = begin
    comes_down(b)


def test_a_device_that_says_up_while_it_settles_is_told_to_park_until_it_is_down():
    b = faulted()
    while b.sent[-1].order is not Order.PARK:
        b.tick()
    b.device.phase, frames = Phase.UP, len(b.sent)
    b.device.take = lambda setpoint: None
    for k in range(120):
        b.device.legs = b.device.neutral - 0.001 * k
        b.tick()
    assert orders(b, frames) == [Order.PARK]
    b.device.phase, b.device.legs = Phase.DOWN, b.device.low
    comes_down(b)
