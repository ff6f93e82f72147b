"""States that are entered: from where, for how long, and the way home."""

from dataclasses import replace

import numpy as np
import pytest
from act_scene import HOMES, LIFTED, NEUTRAL, PERIOD, SECOND, ZERO, Scene, at_rest, moving
from guard_scenes import in_state
from machines import compact
from own_kinematics import lengths

from motionserver.core.axes import frozen
from motionserver.core.device import Feedback, Order, Phase
from motionserver.core.motion.moves import straight_way
from motionserver.core.safety import act, own_moves
from motionserver.core.safety.accept import accept_move
from motionserver.core.safety.states import State

# states that are entered


def test_what_is_entered_is_noted_for_people_and_counted():
    scene = Scene(State.PARKED, Phase.DOWN)
    scene.run(400)
    scene.record.reset_until_ns = 5
    scene.tick(ops=("engage",))
    record = scene.record
    assert record.state is State.RAISING
    assert record.reason == "an operator engaged"
    assert record.since_ns == scene.now
    assert record.events[-1] == (scene.now, "PARKED -> RAISING: an operator engaged")
    assert record.counters["entered_raising"] == 1
    assert record.reset_until_ns == 0


def test_raising_ends_at_rest_at_neutral_within_twenty_seconds():
    scene = Scene(State.PARKED, Phase.DOWN).run(400)
    scene.tick(ops=("engage",))
    assert scene.record.deadline_ns == scene.now + 20 * SECOND
    playback = scene.record.playback
    assert not playback.playing.plan.rest_pose.any()
    assert playback.is_at_rest
    assert playback.clock == playback.playing.plan.duration
    assert playback.playing.plan.plan_id == 2**63 + 1
    assert playback.playing.way_home == straight_way(compact(), ZERO, HOMES[1]).duration


def test_parking_has_twice_the_time_of_plan_way_home_and_settling():
    scene = Scene(State.RUN, playback=moving())
    scene.tick(ops=("park",), is_due=False)
    way = moving().newest.way_home
    assert way > 0.5
    assert scene.record.deadline_ns == scene.now + int(2 * (1.5 + way + 10.0) * SECOND)


def test_parking_from_nowhere_known_has_the_time_of_settling():
    scene = Scene(State.OFFLINE)
    scene.answer["legs"] = None
    scene.run(320)
    assert scene.record.state is State.FAULT
    assert scene.record.reason == "the device measures neither legs nor pose"
    parked = next(at for at, text in scene.record.events if "-> PARKING" in text)
    assert scene.record.deadline_ns == parked + 20 * SECOND


@pytest.mark.parametrize("ops", [(), ("park",)])
def test_a_device_that_stopped_by_itself_plays_nothing_and_owes_nothing(ops):
    scene = Scene(State.PARKING, playback=at_rest())
    scene.answer["legs"] = NEUTRAL + 0.011
    scene.guard.supervisor.device.answered(Feedback(scene.now, Phase.UP, "UP", NEUTRAL + 0.011))
    scene.guard.supervisor.device.track(scene.now, NEUTRAL, ZERO)
    scene.answer["estop"] = True
    scene.tick(200, ops=ops)
    assert scene.record.state is State.SAFE
    assert scene.record.playback is None
    assert scene.guard.supervisor.device.error == 0.0


@pytest.mark.parametrize("as_pose", [False, True])
def test_what_is_found_raised_parks_from_where_it_is_measured(as_pose):
    scene = Scene(State.OFFLINE)
    legs = lengths(compact(), LIFTED)[0]
    # a pose is believed before legs that are told beside it
    scene.answer = {"legs": NEUTRAL, "pose": LIFTED} if as_pose else {"legs": legs}
    scene.run(300)
    scene.tick()
    assert scene.record.state is State.PARKING
    plan = scene.record.playback.playing.plan
    assert scene.record.playback.newest.plan.rest_pose.tolist() == [0.0] * 6
    assert plan.plan_id == 2**63 + 1
    found = plan.pose[0]
    assert found == pytest.approx(LIFTED, abs=1e-9)
    assert (found == LIFTED).all() == as_pose


def test_legs_that_no_pose_has_are_a_fault():
    scene = Scene(State.OFFLINE)
    scene.answer["legs"] = np.full(6, 0.3)
    scene.run(320)
    assert scene.record.state is State.FAULT
    assert "no pose found" in scene.record.reason


def test_where_nobody_can_stand_is_told_twice():
    scene = Scene(State.OFFLINE)
    scene.answer = {"pose": frozen([0.0, 0.0, 0.5, 0.0, 0.0, 0.0])}
    scene.run(320)
    assert scene.record.state is State.FAULT
    assert scene.record.reason.startswith("cannot stand here: plan rejected: leg-length")
    assert scene.record.playback is None
    assert scene.record.reason in [text for _, text in scene.record.events]


@pytest.mark.parametrize(
    ("answer", "told"),
    [
        ({"pose": frozen([0.0, 0.0, 0.5, 0.0, 0.0, 0.0])}, "cannot stand here"),
        ({"legs": np.full(6, 0.3)}, "no pose found"),
        ({}, "neither legs nor pose"),
    ],
)
def test_a_reset_where_it_cannot_be_told_where_the_platform_is_moves_nothing(answer, told):
    """What was played before the fault is not gone on with, and the device does not settle."""
    scene = Scene(State.FAULT, playback=at_rest(LIFTED))
    scene.answer = answer
    scene.run(400)
    scene.record.reset_until_ns = 10**18
    orders = [scene.tick().order for _ in range(50)]
    assert scene.record.playback is None
    assert scene.record.state is State.FAULT
    assert told in scene.record.reason
    assert any("-> PARKING" in text for _, text in scene.record.events)
    assert set(orders) <= {Order.WAIT, Order.RESET}


# the way home


def test_parking_goes_home_once_it_rests_and_settles_when_it_is_there():
    scene = Scene(State.PARKING, playback=at_rest(LIFTED))
    first = scene.tick()
    assert first.order is Order.FOLLOW
    assert first.state.pose.tolist() == LIFTED.tolist()
    (move,) = scene.record.playback.pending
    assert move.plan.plan_id == 2**63 + 1
    assert not move.plan.rest_pose.any()
    wanted = accept_move(compact(), at_rest(LIFTED).newest, 0.01 + PERIOD, ZERO, 2, HOMES)
    assert move.plan.duration == wanted.plan.duration
    for _ in range(int(wanted.plan.duration / PERIOD) + 1):
        setpoint = scene.tick(1)
        legs = setpoint.legs
        scene.answer["legs"] = legs
        assert setpoint.order is Order.FOLLOW
    assert scene.tick(1).order is Order.PARK


def test_only_a_parking_platform_goes_home_by_itself():
    for state in (State.HOLD, State.RUN, State.READY):
        scene = Scene(state, playback=at_rest(LIFTED))
        scene.answer["legs"] = lengths(compact(), LIFTED)[0]
        scene.tick()
        assert scene.record.playback.pending == ()


def test_a_way_home_that_is_not_allowed_is_told_and_a_fault():
    scene = Scene(State.PARKING, playback=at_rest(LIFTED))
    machine = compact()
    scene.guard.moves.machine = replace(machine, pace=replace(machine.pace, speed=1e-4))
    assert scene.tick().state.pose.tolist() == LIFTED.tolist(), "it stands where it was"
    told = scene.guard.supervisor.inconsistent
    assert told.startswith("no way home: plan rejected: malformed")
    assert scene.record.events[-1] == (scene.now, told)
    scene.tick()
    assert scene.record.state is State.FAULT


def test_the_documented_reaches():
    assert (act.UNHEARD, own_moves.REACH) == (1.0, 0.005)


def test_a_guard_begins_anew_with_its_tracking_when_it_is_told_something_else():
    b = in_state("RUN")
    b.guard.supervisor.device.error = 0.5
    assert b.guard.moves.start_at(ZERO, HOMES) == ""
    assert b.guard.supervisor.device.error == 0.0


# what is known of the platform's place


def test_where_it_was_sent_is_remembered_once_it_went_out():
    scene = Scene(State.RUN, playback=moving())
    first = scene.tick()
    assert scene.record.sent_legs.tolist() == first.legs.tolist()
    scene.guard.told(scene.now, True)
    second = scene.tick()
    assert scene.record.sent_legs.tolist() == second.legs.tolist()
    scene.guard.told(scene.now, False)
    assert scene.record.sent_legs.tolist() == first.legs.tolist()


@pytest.mark.parametrize(
    ("state", "phase", "more", "entered"),
    [
        (State.RUN, Phase.UP, {"estop": True}, State.SAFE),
        (State.PARKING, Phase.DOWN, {}, State.PARKED),
    ],
)
def test_a_device_that_moved_by_itself_is_where_nobody_sent_it(state, phase, more, entered):
    scene = Scene(state, playback=at_rest())
    scene.run(320)
    scene.record.sent_legs = NEUTRAL
    scene.phase = phase
    scene.answer |= more
    scene.tick(is_due=False)
    assert scene.record.state is entered
    assert scene.record.playback is None
    assert scene.record.sent_legs is None


def test_in_a_fault_what_is_waited_for_is_told_with_its_reason():
    scene = Scene(State.RUN, playback=at_rest())
    assert scene.guard.reason == scene.record.reason
    scene.answer["faults"] = ("bus",)
    scene.tick()
    assert scene.record.state is State.FAULT
    assert scene.guard.reason == (
        "the device reports bus; the device is told to park as long as it reports bus"
    )
    scene.answer["estop"] = True
    scene.tick()
    assert scene.record.state is State.SAFE
    assert scene.guard.reason == scene.record.reason, "of the fault nothing is told any more"


# a service that ends


def test_who_falls_into_a_fault_while_it_ends_has_the_time_that_parking_may_take():
    scene = Scene(State.RUN, playback=at_rest())
    scene.tick(leave=True)
    assert scene.record.state is State.PARKING
    scene.answer["faults"] = ("bus",)
    scene.tick(is_due=False)
    assert scene.record.state is State.FAULT
    way = at_rest().newest.way_home
    assert scene.record.deadline_ns == scene.now + int(2.0 * (1.0 + way + 10.0) * SECOND)


def test_a_fault_of_a_service_that_stays_needs_no_bound():
    scene = Scene(State.RUN, playback=at_rest())
    before = scene.record.deadline_ns
    scene.answer["faults"] = ("bus",)
    scene.tick(is_due=False)
    assert scene.record.state is State.FAULT
    assert scene.record.deadline_ns == before


def test_who_is_down_while_it_ends_has_no_new_bound():
    scene = Scene(State.PARKING, Phase.DOWN, playback=at_rest())
    scene.run(280)
    scene.tick(leave=True)
    before = scene.record.deadline_ns
    scene.run(80)
    assert scene.record.state is State.PARKED
    assert scene.record.deadline_ns == before


def test_a_reset_that_has_no_effect_in_its_time_is_told():
    scene = Scene(State.FAULT)
    scene.answer["faults"] = ("bus",)
    scene.tick(ops=("reset",))
    scene.run(1996)
    assert "no effect" not in scene.guard.reason
    scene.tick()
    assert "a reset had no effect for 2 s" in scene.guard.reason
    assert scene.record.reset_until_ns == 0
