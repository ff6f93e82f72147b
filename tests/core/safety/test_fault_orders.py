"""What a platform that stands in a fault is told, packet by packet."""

from dataclasses import replace

import numpy as np
import pytest
from act_scene import LIFTED, NEUTRAL, ZERO, Scene, at_rest, moving
from machines import compact
from own_kinematics import lengths

from motionserver.core.device import Feedback, Order, Phase
from motionserver.core.safety.states import State

RAISED_LEGS = lengths(compact(), LIFTED)[0]


def stands(state=State.FAULT, playback=None, legs=NEUTRAL):
    """A platform that has stood, and answered without fault, for two seconds; not looked at yet."""
    scene = Scene(state, playback=playback)
    scene.answer["legs"] = legs
    for k in range(500):
        at = scene.now - (500 - k) * 4_000_000
        scene.guard.supervisor.device.answered(Feedback(at, Phase.UP, "UP", legs))
    return scene


def orders(scene, ms):
    """What it is told in so many milliseconds, runs of one as one."""
    found = []
    for _ in range(ms // 4):
        order = scene.tick().order
        if not found or found[-1] is not order:
            found.append(order)
    return found


def test_a_plan_is_played_to_its_end_and_then_it_is_waited():
    scene = stands(playback=moving(), legs=RAISED_LEGS)
    while scene.record.playback.clock < 2.0:
        assert scene.tick().order is Order.FOLLOW
    assert scene.tick().order is Order.WAIT
    assert scene.record.playback.playing.plan.rest_pose.tolist() == LIFTED.tolist()


def test_from_a_rest_it_goes_straight_home_and_parks():
    scene = stands(playback=at_rest(LIFTED), legs=RAISED_LEGS)
    assert orders(scene, 1000) == [Order.WAIT]
    setpoint = scene.tick()
    assert setpoint.order is Order.FOLLOW
    assert setpoint.legs == pytest.approx(RAISED_LEGS, abs=1e-3)
    assert scene.record.events[-1] == (scene.now, "FAULT: it is on its way home")
    home = scene.record.playback
    assert not home.newest.plan.rest_pose.any()
    for _ in range(2000):
        scene.answer["legs"] = setpoint.legs
        setpoint = scene.tick()
        if setpoint.order is not Order.FOLLOW:
            break
    assert scene.record.playback.is_at_rest
    assert setpoint.legs == pytest.approx(NEUTRAL, abs=1e-9)
    assert orders(scene, 1100)[-1] is Order.PARK
    assert scene.record.playback is not None, "neutral is a place to go on from"
    scene.phase = Phase.DOWN
    assert scene.tick().order is Order.WAIT
    assert scene.record.playback is None
    assert scene.record.sent_legs is None


def test_at_neutral_it_parks_where_it_stands():
    scene = stands(playback=at_rest())
    assert orders(scene, 1100) == [Order.WAIT, Order.PARK]


def test_where_nothing_was_played_it_begins_where_it_is_measured():
    scene = stands(legs=RAISED_LEGS)
    assert orders(scene, 1000) == [Order.WAIT]
    setpoint = scene.tick()
    assert setpoint.order is Order.FOLLOW
    assert setpoint.legs == pytest.approx(RAISED_LEGS, abs=1e-3)
    assert not scene.record.playback.newest.plan.rest_pose.any()


@pytest.mark.parametrize("playback", [None, at_rest(LIFTED)])
def test_a_platform_that_stands_where_nobody_sent_it_is_not_moved(playback):
    scene = stands(playback=playback, legs=NEUTRAL)
    scene.record.sent_legs = RAISED_LEGS
    assert orders(scene, 1500) == [Order.WAIT]
    assert "mm from where it was sent" in scene.guard.reason


def test_where_a_plan_ended_counts_more_than_what_was_sent():
    scene = stands(playback=at_rest(LIFTED), legs=RAISED_LEGS)
    scene.record.sent_legs = NEUTRAL
    assert orders(scene, 1100) == [Order.WAIT, Order.FOLLOW]


def test_what_parks_by_itself_has_no_place_to_go_on_from():
    scene = stands(playback=at_rest(LIFTED), legs=RAISED_LEGS)
    scene.answer["faults"] = ("bus",)
    assert scene.tick().order is Order.PARK
    assert scene.record.playback is None
    neutral = stands(playback=at_rest())
    neutral.answer["faults"] = ("bus",)
    assert neutral.tick().order is Order.PARK
    assert neutral.record.playback is not None


def test_a_plan_of_which_one_sample_is_left_is_followed():
    scene = stands(playback=moving(), legs=RAISED_LEGS)
    scene.record.playback = replace(scene.record.playback, clock=1.999)
    scene.answer["faults"] = ("bus",)
    assert [scene.tick().order for _ in range(2)] == [Order.FOLLOW, Order.PARK]


def test_what_forbids_the_way_home_is_told_and_nothing_moves():
    scene = stands()
    scene.answer["legs"] = None
    assert orders(scene, 1100) == [Order.WAIT]
    told = "it cannot go home by itself: the device measures neither legs nor pose"
    assert scene.guard.supervisor.return_decision.status == told
    assert [text for _, text in scene.record.events] == [f"FAULT: {told}"]


def test_a_way_home_that_is_forbidden_leaves_what_was_played(monkeypatch):
    scene = stands(playback=at_rest(LIFTED), legs=RAISED_LEGS)
    monkeypatch.setattr(scene.guard.moves, "homeward", lambda playback: "no way")
    assert orders(scene, 1100) == [Order.WAIT]
    assert scene.record.playback.playing.plan.rest_pose.tolist() == LIFTED.tolist()
    assert scene.guard.supervisor.return_decision.status == "it cannot go home by itself: no way"


def test_the_way_home_is_tracked_anew():
    scene = stands(playback=at_rest(LIFTED), legs=RAISED_LEGS)
    device = scene.guard.supervisor.device
    device.track(scene.now, RAISED_LEGS + 0.02, ZERO)
    assert device.error == pytest.approx(0.02)
    orders(scene, 1000)
    scene.answer["legs"] = RAISED_LEGS + 0.0095
    assert scene.tick().order is Order.FOLLOW
    scene.answer["legs"] = RAISED_LEGS + 0.02
    scene.tick()
    assert not scene.guard.supervisor.astray, "it is borne for a while"


def test_on_the_way_home_an_error_of_before_is_not_shown_for_one_that_is_not_measured():
    scene = stands(playback=at_rest(LIFTED), legs=RAISED_LEGS)
    device = scene.guard.supervisor.device
    device.track(scene.now, RAISED_LEGS + 0.02, ZERO)
    assert device.error == pytest.approx(0.02)
    scene.answer["legs"] = None
    assert orders(scene, 1004) == [Order.WAIT, Order.FOLLOW]
    assert device.error == 0.0


# resets and stops


@pytest.mark.parametrize(("state", "after"), [(State.FAULT, Order.PARK), (State.SAFE, Order.WAIT)])
def test_a_reset_is_asked_of_the_device_until_its_time_is_over(state, after):
    scene = stands(state)
    scene.answer["faults"] = ("bus",)
    scene.record.reset_until_ns = scene.now + 12_000_000
    found = [scene.tick().order for _ in range(4)]
    assert found == [Order.RESET, Order.RESET, after, after]


def test_while_a_reset_is_tried_nothing_goes_home():
    scene = stands(playback=at_rest(LIFTED), legs=RAISED_LEGS)
    scene.answer["faults"] = ("bus",)
    scene.record.reset_until_ns = scene.now + 3_000_000_000
    assert orders(scene, 2000) == [Order.RESET]
    assert scene.record.playback is not None


@pytest.mark.parametrize("leaving", [False, True])
@pytest.mark.parametrize("estop", [False, True])
def test_an_open_stop_is_followed_and_a_closed_one_by_a_service_that_stays(leaving, estop):
    scene = stands(State.SAFE, playback=at_rest(LIFTED), legs=RAISED_LEGS)
    scene.record.leaving = leaving
    scene.answer["estop"] = estop
    comes_down = leaving and not estop
    assert orders(scene, 1100) == ([Order.WAIT, Order.FOLLOW] if comes_down else [Order.WAIT])
    assert (scene.record.playback is not None) is comes_down


def test_a_service_that_ends_waits_beside_a_device_that_never_answered():
    scene = Scene(State.SAFE)
    scene.answers, scene.record.leaving = False, True
    assert orders(scene, 100) == [Order.WAIT]


# where it was sent last


@pytest.mark.parametrize("order", list(Order))
def test_where_it_was_sent_is_kept_until_it_lifts_by_itself(order):
    scene = Scene()
    scene.record.sent_legs = NEUTRAL
    scene.guard.fault_return.sent(order, RAISED_LEGS)
    kept = scene.record.sent_legs
    if order is Order.RAISE:
        assert kept is None
    else:
        assert kept is (RAISED_LEGS if order is Order.FOLLOW else NEUTRAL)


def test_news_of_a_fault_are_told_with_the_state_and_nothing_is_told_twice():
    scene = stands()
    scene.answer["faults"] = ("bus",)
    orders(scene, 400)
    assert [text for _, text in scene.record.events] == [
        "FAULT: the device is told to park as long as it reports bus"
    ]
    assert np.isfinite(scene.record.events[0][0])
