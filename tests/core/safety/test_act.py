"""One tick of the guard: what is sent, what is entered, what is counted, exactly at the limits."""

from dataclasses import replace

import numpy as np
import pytest
from guard_scenes import in_state
from machines import compact
from own_kinematics import lengths

from motionserver.core.axes import frozen
from motionserver.core.device import Feedback, Order, Phase
from motionserver.core.motion.moves import rest_to_rest, straight_way
from motionserver.core.motion.player import Playback
from motionserver.core.safety import act
from motionserver.core.safety.accept import accept_move, accept_rest
from motionserver.core.safety.act import Guard
from motionserver.core.safety.given import GuardConfig, Request, TickInput
from motionserver.core.safety.states import State
from motionserver.core.safety.verdict import Reason
from motionserver.core.safety.watchdog import CueStatus
from motionserver.core.state import DriveMode

MS = 1_000_000
SECOND = 1_000_000_000
PERIOD = 1 / 64
"""Of packets and of plans [s]."""
ZERO = frozen(np.zeros(6))
HOMES = np.stack((ZERO, compact().parked_pose))
NEUTRAL = lengths(compact(), ZERO)[0]
LIFTED = frozen([0.0, 0.0, 0.05, 0.0, 0.0, 0.0])


def at_rest(pose=ZERO, number=1):
    accepted = accept_rest(compact(), pose, number, HOMES)
    return Playback(accepted, accepted.plan.duration)


class Scene:
    """A guard in a state, a device that answers at every tick, and nothing else."""

    def __init__(self, state=State.OFFLINE, phase=Phase.UP, playback=None, **config):
        self.guard = Guard(GuardConfig(compact(), PERIOD, PERIOD, **config))
        self.record = self.guard.record
        self.record.state, self.record.playback = state, playback
        self.record.deadline_ns = 10**18
        self.now = self.record.since_ns = 10 * SECOND
        self.phase, self.answer = phase, {"legs": NEUTRAL}
        self.answers = self.drives = True

    def tick(self, ms=4, is_due=True, ops=(), proposal=None, ns=0, leave=False):
        self.now += ms * MS + ns
        answer = Feedback(self.now, self.phase, self.phase.name, **self.answer)
        cue = CueStatus(self.now, 150 * MS, DriveMode.DRIVE)
        self.record.accepted_ns = self.now if self.drives else self.record.accepted_ns
        setpoint, answers = self.guard.tick(
            TickInput(
                self.now,
                (ms * MS + ns) / 1e9,
                is_due,
                (answer,) if self.answers else (),
                cue,
                proposal,
                tuple(Request(op, "console") for op in ops),
                leave,
            )
        )
        assert len(answers) == len(ops)
        return setpoint

    def run(self, ms):
        for _ in range(ms // 4):
            self.tick()
        return self


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


def moving():
    """A move to 5 cm above neutral within two seconds, half a second under way."""
    rest = at_rest()
    child = rest_to_rest(2, 1, 0.0, ZERO, LIFTED, 2.0)
    accepted = replace_plan(rest, child)
    return Playback(accepted, 0.5)


def replace_plan(rest, plan):
    return replace(rest.newest, plan=plan, before=rest.newest.plan)


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


# what the network refused


def test_a_sample_that_did_not_go_out_is_the_next_one():
    scene = Scene(State.RUN, playback=moving())
    first = scene.tick()
    scene.guard.told(scene.now, False)
    assert scene.record.playback.clock == 0.5
    again = scene.tick()
    scene.guard.told(scene.now, True)
    assert again.state.pose.tolist() == first.state.pose.tolist()
    assert scene.tick().state.pose[2] > first.state.pose[2]


def test_a_sample_that_a_guard_before_owed_is_owed_until_it_goes_out():
    scene = Scene(State.RUN, playback=moving())
    scene.guard.owes_sample = True
    first = scene.tick()
    assert not scene.guard.owes_sample
    assert scene.record.playback.clock == 0.5
    scene.guard.told(scene.now, False)
    assert scene.guard.owes_sample
    assert scene.tick().state.pose.tolist() == first.state.pose.tolist()
    scene.guard.told(scene.now, True)
    scene.tick()
    assert scene.record.playback.clock == 0.5 + PERIOD


@pytest.mark.parametrize("state", sorted(act.RAISED))
def test_a_network_that_refuses_for_more_than_100_ms_is_a_fault_while_raised(state):
    scene = Scene(state, playback=moving())
    scene.tick()
    begin = scene.now
    scene.guard.told(begin, False)
    scene.guard.told(begin + 100 * MS, False)
    assert scene.guard.supervisor.inconsistent == ""
    scene.guard.told(begin + 100 * MS + 1, False)
    assert scene.guard.supervisor.inconsistent != ""
    scene.guard.told(begin + 1234 * MS, False)
    assert scene.guard.supervisor.inconsistent == (
        "the network takes no setpoint for 1234 ms: see to the way to the platform"
    )


def test_a_network_that_refuses_before_anything_was_played_takes_nothing_away():
    scene = Scene()
    scene.guard.told(scene.now, False)
    assert scene.record.playback is None
    assert not scene.guard.owes_sample


def test_one_setpoint_that_goes_out_ends_what_the_network_refused():
    scene = Scene(State.RUN, playback=moving())
    scene.tick()
    scene.guard.told(scene.now, False)
    scene.guard.told(scene.now + 50 * MS, True)
    scene.guard.told(scene.now + 101 * MS, False)
    assert scene.guard.supervisor.inconsistent == ""


def test_a_network_that_refuses_while_parked_is_no_fault():
    scene = Scene(State.PARKED, Phase.DOWN)
    scene.tick()
    scene.guard.told(scene.now, False)
    scene.guard.told(scene.now + 5 * SECOND, False)
    assert scene.guard.supervisor.inconsistent == ""


def test_after_a_second_unheard_the_plan_of_a_fault_is_given_up():
    scene = Scene(State.FAULT, playback=moving())
    scene.tick()
    scene.guard.told(scene.now, False)
    scene.guard.told(scene.now + SECOND, False)
    assert scene.record.playback is not None
    scene.guard.told(scene.now + SECOND + 1, False)
    assert scene.record.playback is None
    running = Scene(State.RUN, playback=moving())
    running.tick()
    running.guard.told(running.now, False)
    running.guard.told(running.now + 2 * SECOND, False)
    assert running.record.playback is not None


def test_plans_are_waited_for_anew_after_what_the_network_refused():
    scene = Scene(State.RUN, playback=at_rest())
    scene.tick()
    scene.drives = False
    for _ in range(20):
        scene.tick()
        scene.guard.told(scene.now, False)
    assert scene.record.state is State.RUN
    for _ in range(12):
        scene.tick()
        scene.guard.told(scene.now, True)
    assert scene.record.state is State.HOLD


# proposals


def test_an_accepted_proposal_follows_and_is_counted_with_its_instant():
    scene = Scene(State.RUN, playback=at_rest())
    scene.drives = False
    plan = rest_to_rest(7, 1, 0.1, ZERO, LIFTED, 2.0)
    scene.tick(proposal=plan)
    assert scene.guard.judged is plan
    assert scene.record.playback.newest.plan is plan
    assert scene.record.accepted_ns == scene.now
    assert scene.record.counters["plans_accepted"] == 1
    assert scene.record.counters["plans_rejected"] == 0
    scene.tick()
    assert scene.guard.judged is None


def test_a_rejected_proposal_is_counted_and_kept_with_its_reason():
    scene = Scene(State.RUN, playback=at_rest())
    before = scene.record.accepted_ns
    scene.drives = False
    plan = rest_to_rest(7, 5, 0.1, ZERO, LIFTED, 2.0)
    scene.tick(proposal=plan)
    assert scene.guard.judged is plan
    assert scene.record.accepted_ns == before
    assert scene.record.counters["plans_accepted"] == 0
    assert scene.record.counters["plans_rejected"] == 1
    assert scene.record.counters["rejected_wrong-parent"] == 1
    (when, why) = scene.record.rejections[-1]
    assert (when, why.reason) == (scene.now, Reason.WRONG_PARENT)


@pytest.mark.parametrize(
    ("state", "playback"), [(State.PARKED, None), (State.PARKED, at_rest()), (State.RUN, None)]
)
def test_where_nothing_is_cued_no_proposal_is_taken(state, playback):
    scene = Scene(state, Phase.DOWN if state is State.PARKED else Phase.UP, playback)
    scene.tick(proposal=rest_to_rest(7, 1, 0.1, ZERO, LIFTED, 2.0))
    assert scene.record.counters["rejected_not-cueing"] == 1


def test_a_proposal_that_overtakes_one_that_waits_is_counted():
    scene = Scene(State.RUN, playback=at_rest(), slices=1)
    first, second, third = (rest_to_rest(number, 1, 0.3, ZERO, LIFTED, 2.0) for number in (7, 8, 9))
    scene.tick(proposal=first)
    assert scene.guard.is_checking
    assert scene.guard.judged is None
    scene.tick(proposal=second)
    scene.tick()
    assert scene.record.counters["plans_overtaken"] == 0
    scene.tick(proposal=third)
    assert scene.record.counters["plans_overtaken"] == 1
    while scene.guard.is_checking:
        scene.tick()
        if scene.guard.judged is not None:
            break
    assert scene.guard.judged is first
    assert scene.record.counters["plans_accepted"] == 1


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
    scene.guard.machine = replace(machine, pace=replace(machine.pace, speed=1e-4))
    assert scene.tick().state.pose.tolist() == LIFTED.tolist(), "it stands where it was"
    told = scene.guard.supervisor.inconsistent
    assert told.startswith("no way home: plan rejected: malformed")
    assert scene.record.events[-1] == (scene.now, told)
    scene.tick()
    assert scene.record.state is State.FAULT


def test_the_documented_reaches():
    assert (act.UNHEARD, act.REACH) == (1.0, 0.005)


def test_a_guard_begins_anew_with_its_tracking_when_it_is_told_something_else():
    b = in_state("RUN")
    b.guard.supervisor.device.error = 0.5
    b.guard._start_at(ZERO, HOMES, b.now)
    assert b.guard.supervisor.device.error == 0.0
