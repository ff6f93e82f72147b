"""One tick of the guard: what is sent and played, exactly at the limits."""

from dataclasses import replace

import numpy as np
import pytest
from act_scene import MS, NEUTRAL, PERIOD, SECOND, Scene, at_rest, moving
from machines import compact
from own_kinematics import lengths

from motionserver.core.device import Order, Phase
from motionserver.core.motion.player import Playback
from motionserver.core.safety.states import State


def test_a_new_guard_sends_the_mode_word_at_neutral():
    scene = Scene()
    assert scene.guard.judged is None
    assert not scene.guard.is_checking
    assert not Scene(slices=1).guard.is_checking
    assert not scene.guard.owes_sample
    setpoint = scene.tick()
    assert setpoint.order is Order.WAIT
    assert not setpoint.state.pose.any()
    assert setpoint.legs == pytest.approx(NEUTRAL, abs=1e-12)


def test_nothing_is_sent_where_nothing_is_due():
    scene = Scene()
    assert scene.tick(is_due=False) is None
    assert scene.record.counters["setpoints"] == 0
    scene.tick()
    assert scene.record.counters["setpoints"] == 1


def test_who_is_told_once_to_leave_leaves():
    scene = Scene(State.RUN, playback=at_rest())
    scene.tick(leave=True)
    assert scene.record.state is State.PARKING
    scene.tick()
    assert scene.record.leaving


# orders


@pytest.mark.parametrize(
    ("state", "order"),
    [
        (State.OFFLINE, Order.WAIT),
        (State.PARKED, Order.WAIT),
        (State.READY, Order.FOLLOW),
        (State.RUN, Order.FOLLOW),
        (State.HOLD, Order.FOLLOW),
        (State.PARKING, Order.PARK),
        (State.FAULT, Order.WAIT),
        (State.SAFE, Order.WAIT),
    ],
)
def test_what_a_resting_platform_is_told(state, order):
    scene = Scene(state, playback=at_rest())
    assert scene.tick().order is order


def test_raising_is_told_to_the_device_until_it_is_there():
    scene = Scene(State.RAISING, Phase.RAISING, at_rest())
    assert scene.tick().order is Order.RAISE


def test_a_fault_plays_its_plan_to_the_end_and_then_tells_a_faulty_device_to_settle():
    scene = Scene(State.FAULT, playback=Playback(moving().newest, 1.97))
    scene.answer["faults"] = ("bus",)
    assert scene.tick().order is Order.FOLLOW
    assert scene.tick().order is Order.FOLLOW
    assert scene.tick().order is Order.PARK
    scene.answer["faults"] = ()
    assert scene.tick().order is Order.WAIT


def test_a_faulty_device_that_was_stopped_by_hand_is_told_nothing():
    scene = Scene(State.SAFE)
    scene.answer["faults"] = ("bus",)
    assert scene.tick().order is Order.WAIT


def test_a_fault_before_the_first_answer_only_waits():
    scene = Scene(State.FAULT)
    scene.answers = False
    assert scene.tick().order is Order.WAIT


@pytest.mark.parametrize("state", [State.OFFLINE, State.PARKED, State.SAFE])
def test_where_nothing_is_played_nothing_is_followed_whatever_is_left_over(state):
    scene = Scene(state, Phase.DOWN, moving())
    assert scene.tick().order is Order.WAIT


@pytest.mark.parametrize("state", [State.OFFLINE, State.PARKED])
def test_where_nothing_is_latched_no_reset_is_sent(state):
    scene = Scene(state, Phase.DOWN)
    scene.record.reset_until_ns = 10**18
    assert scene.tick().order is Order.WAIT


@pytest.mark.parametrize("state", [State.FAULT, State.SAFE])
def test_a_reset_is_sent_to_its_last_nanosecond(state):
    scene = Scene(state, Phase.LOWERING)
    scene.tick(ops=("reset",))
    until = scene.now + 2 * SECOND
    assert scene.record.reset_until_ns == until
    scene.answer["faults"] = ("bus",)
    assert scene.tick(ns=until - scene.now - 4 * MS - 1).order is Order.RESET
    last = scene.tick(0, ns=1)
    assert scene.now == until
    assert last.order is (Order.PARK if state is State.FAULT else Order.WAIT)


def test_a_reset_does_not_interrupt_a_plan_that_is_played():
    scene = Scene(State.FAULT, Phase.LOWERING, moving())
    scene.record.reset_until_ns = 10**18
    assert scene.tick().order is Order.FOLLOW


# what is played


def test_the_clock_runs_by_a_packet_and_the_sample_is_that_of_the_new_clock():
    scene = Scene(State.RUN, playback=moving())
    setpoint = scene.tick()
    assert scene.record.playback.clock == 0.5 + PERIOD
    wanted = moving().newest.plan.state(0.5 + PERIOD)
    assert setpoint.state.pose.tolist() == wanted.pose.tolist()
    assert setpoint.legs == pytest.approx(lengths(compact(), wanted.pose)[0], abs=1e-12)
    assert not setpoint.legs.flags.writeable


def test_a_dry_run_plays_but_sends_the_mode_word_and_does_not_mind_where_the_legs_are():
    scene = Scene(State.RUN, Phase.DOWN, moving(), dry_run=True)
    scene.answer["legs"] = NEUTRAL - 0.2
    for _ in range(40):
        assert scene.tick().order is Order.WAIT
    assert scene.record.state is State.RUN
    assert scene.record.playback.clock == 0.5 + 40 * PERIOD


def test_a_platform_far_from_what_it_was_sent_is_astray_at_the_next_tick():
    scene = Scene(State.RUN, playback=at_rest())
    scene.answer["legs"] = NEUTRAL + 0.011
    for _ in range(26):
        scene.tick()
    assert scene.record.state is State.RUN, "for 100 ms"
    scene.tick()
    assert scene.guard.supervisor.astray
    scene.tick()
    assert scene.record.state is State.FAULT
    assert scene.record.reason == "the platform does not follow: 11.0 mm off"


def test_a_fast_platform_may_lag_further():
    scene = Scene(State.RUN, playback=replace(moving(), clock=1.0))
    for _ in range(20):
        legs = lengths(compact(), scene.guard._last.state.pose)[0]
        scene.answer["legs"] = (NEUTRAL if scene.now == 10 * SECOND else legs) - 0.0125
        scene.tick()
        assert not scene.guard.supervisor.astray
    assert scene.record.state is State.RUN


@pytest.mark.parametrize("end", ["leg_min", "leg_max"])
def test_a_leg_may_be_exactly_at_the_end_of_its_stroke_and_no_further(end):
    legs = Scene(State.RUN, playback=moving()).tick().legs
    edge, beyond = (
        (legs.min(), np.nextafter(legs.min(), 9.0))
        if end == "leg_min"
        else (legs.max(), np.nextafter(legs.max(), 0.0))
    )
    for limit, inside in ((edge, True), (beyond, False)):
        scene = Scene(State.RUN, playback=moving())
        scene.guard.machine = replace(compact(), **{end: float(limit)})
        setpoint = scene.tick()
        assert (scene.guard.supervisor.inconsistent == "") is inside
        assert setpoint.order is (Order.FOLLOW if inside else Order.WAIT)
        assert (scene.record.playback is not None) is inside


def test_what_leads_outside_is_replaced_by_what_was_sent_last():
    scene = Scene(State.RUN, playback=moving())
    last = scene.tick()
    scene.guard.machine = replace(compact(), leg_max=1.0)
    assert scene.tick() is last
    assert scene.record.counters["setpoints"] == 1
    assert scene.record.playback is None
    scene.tick()
    assert scene.record.state is State.FAULT
    assert scene.record.reason == "an accepted plan led outside the stroke"
