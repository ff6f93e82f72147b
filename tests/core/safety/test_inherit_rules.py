"""What a successor believes of a will written by hand, exactly at the limits."""

from dataclasses import replace

import numpy as np
import pytest
from machines import compact
from own_kinematics import lengths

from motionserver.core.axes import frozen
from motionserver.core.device import Feedback, Phase
from motionserver.core.kinematics.hexapod import leg_speeds
from motionserver.core.motion.moves import rest_to_rest
from motionserver.core.plan import rest_at
from motionserver.core.safety.act import Guard
from motionserver.core.safety.given import GuardConfig
from motionserver.core.safety.inherit import inherit
from motionserver.core.safety.states import State
from motionserver.core.safety.watchdog import Patience
from motionserver.core.safety.will import Will

MS = 1_000_000
NOW = 20_000 * MS
ZERO = frozen(np.zeros(6))
NEUTRAL = lengths(compact(), ZERO)[0]
UP = frozen([0.0, 0.0, 0.05, 0.0, 0.0, 0.0])
REST = rest_at(ZERO, 1)
RISE = rest_to_rest(2, 1, 0.01, ZERO, UP, 2.0)
SINK = rest_to_rest(3, 2, 2.0, UP, ZERO, 2.0)
FAR = rest_at(frozen([0.1975, -0.0177, 0.0, -0.0065, -0.0249, -0.0085]), 4)
"""Straight to neutral, but through the end of the stroke on the straight way to where it parks."""


def will(**more):
    """Of a guard that rose to 5 cm, a second ago, with a way back that waits; all is well."""
    known = {
        "due_ns": NOW,
        "state": State.RUN,
        "reason": "because",
        "since_ns": 11,
        "deadline_ns": 22,
        "accepted_ns": 33,
        "leaving": False,
        "engaged_once": False,
        "next_id": 44,
        "taken_ns": 0,
        "clock": 1.0,
        "feedback": answer(RISE.state(1.0).pose),
        "counters": {"setpoints": 5},
        "before": REST,
        "plans": (RISE, SINK),
    }
    return Will(**known | more)


def answer(pose, phase=Phase.UP, off=0.0):
    return Feedback(NOW - 10 * MS, phase, phase.name, lengths(compact(), pose)[0] + off)


def inherited(left, now=NOW, **patience):
    guard = Guard(GuardConfig(compact(), 1 / 60, 0.0125, patience=Patience(**patience)))
    return inherit(guard, left, now), guard


def note(guard):
    ((_, text),) = guard.record.events
    return text


def test_everything_goes_on():
    left = will(leaving=True, engaged_once=True)
    goes_on, guard = inherited(left)
    record = guard.record
    assert goes_on is True
    assert (record.state, record.reason) == (State.RUN, "because")
    assert (record.since_ns, record.deadline_ns, record.accepted_ns) == (11, 22, 33)
    assert record.leaving is record.engaged_once is True
    assert record.take_id() == 45
    assert record.counters == {"setpoints": 5, "takeovers": 1}
    assert not guard.owes_sample
    assert guard.supervisor.device.newest is left.feedback
    assert list(record.events) == [(NOW, "the guard before ended in RUN; goes on in it")]


def test_each_plan_keeps_the_one_it_took_over_from_and_the_clock_its_time():
    playback = inherited(will())[1].record.playback
    assert playback.clock == 1.0
    assert playback.playing.plan is RISE
    assert playback.playing.before is REST
    (waiting,) = playback.pending
    assert waiting.plan is SINK
    assert waiting.before is RISE


def test_a_sample_that_did_not_go_out_is_owed():
    guard = Guard(GuardConfig(compact(), 1 / 60, 0.0125))
    assert inherit(guard, will(), NOW, is_sent=False)
    assert guard.owes_sample


def test_who_was_parked_and_played_nothing_is_parked():
    left = will(state=State.PARKED, plans=(), before=None, clock=0.0)
    goes_on, guard = inherited(left)
    assert goes_on
    assert guard.record.state is State.PARKED
    assert guard.record.playback is None


def test_answers_are_waited_for_anew_by_who_takes_over():
    guard = inherited(will())[1]
    guard.supervisor.source.update(NOW, None)
    assert not guard.supervisor.device.is_lost(NOW + 100 * MS)
    assert guard.supervisor.device.is_lost(NOW + 101 * MS)


def test_a_packet_may_be_late_by_a_tenth_of_a_second():
    assert inherited(will(), NOW + 100 * MS)[0]
    begins_anew, guard = inherited(will(), NOW + 100 * MS + 1)
    assert begins_anew is False
    assert guard.record.state is State.OFFLINE
    assert guard.record.playback is None
    guard = inherited(will(), NOW + 1234 * MS)[1]
    assert note(guard) == (
        "the guard before ended in RUN; begins anew: its packet was due 1234 ms ago"
    )


def test_what_a_guard_was_left_is_passed_on_after_a_second_of_life():
    assert inherited(will(taken_ns=NOW - 1000 * MS))[0]
    begins_anew, guard = inherited(will(taken_ns=NOW - 1000 * MS + 1))
    assert begins_anew is False
    assert note(guard).endswith("begins anew: it had taken over itself just before")


def test_who_never_took_over_passes_it_on_also_in_the_first_second_of_the_computer():
    early = 500 * MS
    assert inherited(will(due_ns=early, feedback=None), early)[0]


@pytest.mark.parametrize("state", [State.FAULT, State.SAFE])
def test_what_is_latched_stays_and_its_plan_goes_on_if_it_is_believed(state):
    stays, guard = inherited(will(state=state))
    assert stays
    assert guard.record.playback.playing.plan is RISE
    assert note(guard) == f"the guard before ended in {state}; goes on in it"
    wild = replace(RISE, pose=frozen(10.0 * RISE.pose))
    for left in (
        will(state=state, plans=(wild,)),
        will(state=state, clock=0.0),
        will(state=state, taken_ns=NOW - 1),
        will(state=state, due_ns=NOW - 500 * MS),
    ):
        stays, guard = inherited(left)
        assert stays
        assert guard.record.state is state
        assert guard.record.playback is None
        assert note(guard) == f"the guard before ended in {state}; stays in it"


def test_every_plan_is_checked_again_as_the_child_of_the_one_before():
    elsewhere = rest_to_rest(3, 2, 2.0, ZERO, UP, 2.0)
    for plans, why in (
        ((RISE, elsewhere), "discontinuous"),
        ((replace(RISE, pose=frozen(10.0 * RISE.pose)),), "leg-length"),
    ):
        begins_anew, guard = inherited(will(plans=plans))
        assert begins_anew is False
        assert f"begins anew: plan rejected: {why}" in note(guard)
        assert guard.record.playback is None


def test_a_rest_needs_a_way_to_neutral_only_and_a_plan_to_both():
    far = FAR.rest_pose
    assert inherited(will(before=None, plans=(FAR,), feedback=answer(far)))[0]
    there = rest_to_rest(5, 1, 0.01, ZERO, far, 4.0)
    begins_anew, guard = inherited(will(plans=(there,), clock=4.0, feedback=answer(far)))
    assert begins_anew is False
    assert "no-way-home" in note(guard)


# where the platform is


def gap_at(clock, feedback):
    """Leg distances between plan and answer as the successor computes them, and leg speeds."""
    state = RISE.state(clock)
    legs, speeds = leg_speeds(compact(), state.pose[None], state.velocity[None])
    return np.abs(feedback.legs - legs[0]), np.abs(speeds[0])


def test_a_resting_platform_may_be_as_far_from_its_plan_as_tracking_allows():
    off = np.array([0.0, 0.008, 0.0, 0.0, -0.012, 0.0])
    left = will(clock=2.0, feedback=answer(UP, off=off), plans=(RISE,))
    largest = float(gap_at(2.0, left.feedback)[0].max())
    assert largest == pytest.approx(0.012)
    assert inherited(left, track=largest)[0]
    begins_anew, guard = inherited(left, track=np.nextafter(largest, 0.0))
    assert begins_anew is False
    assert note(guard).endswith("begins anew: the platform is 12 mm from its plan")


def test_a_moving_platform_may_lag_further():
    left = will(feedback=answer(RISE.state(1.0).pose, off=-0.0125))
    speeds = gap_at(1.0, left.feedback)[1]
    assert (0.010 + 0.15 * speeds > 0.0125).all()
    assert inherited(left)[0]
    assert not inherited(left, track_lag=0.0)[0]


def test_how_far_it_is_is_told_of_the_leg_that_is_furthest():
    off = np.array([0.0, 0.0, 0.0, 0.6, 0.0, 0.0])
    guard = inherited(will(clock=2.0, plans=(RISE,), feedback=answer(UP, off=off)))[1]
    assert note(guard).endswith("the platform is 600 mm from its plan")


@pytest.mark.parametrize(
    "feedback",
    [
        None,
        answer(ZERO, Phase.RAISING, off=0.3),
        answer(ZERO, Phase.LOWERING, off=0.3),
        Feedback(NOW, Phase.UP, "UP"),
    ],
    ids=["none yet", "raising", "lowering", "unmeasured"],
)
def test_what_is_not_measured_on_a_raised_platform_is_no_objection(feedback):
    assert inherited(will(feedback=feedback))[0]
