"""A check over several ticks says what the whole check says, and never plays what has gone by."""

from dataclasses import replace

import numpy as np
import pytest
from machines import compact
from proposals import Proposer

from motionserver.core.axes import frozen
from motionserver.core.motion.moves import rest_to_rest
from motionserver.core.motion.player import MOST_PENDING, Playback, advance, follow
from motionserver.core.plan import Plan
from motionserver.core.safety.accept import accept_in_slices, accept_proposal, accept_rest
from motionserver.core.safety.patient import (
    BLOCK,
    SHORT,
    PatientCheck,
    slices_per_tick,
    time_of_check,
)
from motionserver.core.safety.slices import whole
from motionserver.core.safety.states import State
from motionserver.core.safety.verdict import AcceptedPlan, Reason, Rejection

ZERO = frozen(np.zeros(6))
HOMES = np.stack((ZERO, compact().parked_pose))
STANDING = accept_rest(compact(), ZERO, 1, HOMES)


def proposal(takeover=0.1, plan_id=2, parent_id=1, goal=(0.05, 0.0, 0.0, 0.0, 0.0, 0.0)):
    return rest_to_rest(plan_id, parent_id, takeover, ZERO, frozen(goal), 1.0)


def standing(clock=0.05):
    return Playback(STANDING, clock)


def patient(slices=2):
    return PatientCheck(compact(), HOMES, slices)


def verdict_of(check, playback, state=State.RUN):
    """Tick until there is a verdict, and how many ticks it took."""
    for ticks in range(1, 40):
        found = check.tick(state, playback)
        if found is not None:
            return found[1], ticks
    raise AssertionError("no verdict")


def assert_same(found, wanted):
    assert type(found) is type(wanted)
    if isinstance(wanted, Rejection):
        assert found == wanted
    else:
        assert found.plan is wanted.plan
        assert found.before is wanted.before
        assert found.way_home == wanted.way_home


@pytest.mark.parametrize("seed", range(4))
def test_slices_say_to_the_bit_what_the_whole_says(seed):
    machine = compact()
    if seed == 1:
        machine = replace(machine, passenger_acceleration=1.0)
    homes = np.stack((ZERO, machine.parked_pose))
    propose = Proposer(machine, seed)
    playback = Playback(accept_rest(machine, ZERO, 10**9, homes))
    seen = set()
    for number in range(500):
        plan = propose(playback)
        parent, clock = playback.newest, playback.newest_clock
        wanted = accept_proposal(machine, plan, parent, clock, homes)
        for block in (BLOCK, 100 + number % 400):
            assert_same(whole(accept_in_slices(machine, plan, parent, clock, homes, block)), wanted)
        check = PatientCheck(machine, homes, 1 + number % 4)
        check.offer(plan)
        found, _ = verdict_of(check, playback)
        assert_same(found, wanted)
        seen.add(getattr(wanted, "reason", "accepted"))
        if isinstance(wanted, AcceptedPlan) and len(playback.pending) < MOST_PENDING - 1:
            playback = follow(playback, wanted)
        playback = advance(playback, 1 / 60)
    assert len(seen) >= 9, seen


def test_how_many_slices_a_tick_has_room_for():
    assert [slices_per_tick(1 / rate) for rate in (60, 240, 333, 334, 480, 1000)] == [
        *(0, 0, 0, 5, 4, 2)
    ]
    assert slices_per_tick(SHORT) == 0
    assert slices_per_tick(1e-4) == 1
    assert slices_per_tick(np.nextafter(0.002, 0.0)) == 4, "short by rounding only"
    assert time_of_check(1 / 240) == 0.0
    assert time_of_check(0.001) == pytest.approx(0.005)


@pytest.mark.parametrize(
    ("duration", "samples", "ticks"),
    [(1.0, 507, 6), (1.0395, 527, 6), (1.0415, 528, 7), (4.0, 2007, 9)],
)
def test_a_slice_is_512_samples_and_the_longest_check_takes_the_time_the_planner_allows(
    duration, samples, ticks
):
    """From three samples before the hand-over to three after the end; fifteen are no block."""
    assert samples == 3 + np.ceil(duration / 0.002) + 4
    check = patient(1)
    check.offer(rest_to_rest(2, 1, 0.1, ZERO, frozen([0.01, 0, 0, 0, 0, 0]), duration))
    found, took = verdict_of(check, standing())
    assert isinstance(found, AcceptedPlan)
    assert took == ticks
    assert took * 0.0005 <= time_of_check(0.0005)


def test_it_is_busy_from_the_first_slice_to_the_verdict():
    check = patient(1)
    assert not check.is_busy
    check.offer(proposal())
    check.tick(State.RUN, standing())
    assert check.is_busy
    verdict_of(check, standing())
    assert not check.is_busy


def test_a_check_takes_ticks_and_fewer_with_more_slices():
    ticks = []
    for slices in (1, 2, 4, 100):
        check = patient(slices)
        check.offer(proposal())
        found, took = verdict_of(check, standing())
        assert isinstance(found, AcceptedPlan)
        assert not check.is_busy
        ticks.append(took)
    assert ticks == sorted(ticks, reverse=True)
    assert ticks[0] >= 4
    assert ticks[-1] == 1


def test_too_late_is_judged_at_the_end_too():
    check, plan = patient(1), proposal(takeover=0.1)
    check.offer(plan)
    assert check.tick(State.RUN, standing(0.05)) is None
    found, _ = verdict_of(check, standing(np.nextafter(0.1, 1.0)))
    assert found.reason is Reason.TOO_LATE
    check.offer(plan)
    check.tick(State.RUN, standing(0.05))
    found, _ = verdict_of(check, standing(0.1))
    assert isinstance(found, AcceptedPlan)


def test_a_plan_that_is_late_already_is_told_at_once():
    check = patient(1)
    check.offer(proposal(takeover=0.01))
    found, ticks = verdict_of(check, standing())
    assert (found.reason, ticks) == (Reason.TOO_LATE, 1)


def test_another_parent_meanwhile_ends_it_even_one_of_the_same_number():
    for other in (
        accept_rest(compact(), ZERO, 1, HOMES),
        accept_proposal(compact(), proposal(), STANDING, 0.05, HOMES),
    ):
        check = patient(1)
        check.offer(proposal(plan_id=3))
        check.tick(State.RUN, standing())
        found, ticks = verdict_of(check, Playback(other, 0.05))
        assert (found.reason, ticks) == (Reason.WRONG_PARENT, 1)
        assert not check.is_busy


@pytest.mark.parametrize("state", [State.PARKING, State.FAULT, State.PARKED])
def test_a_state_that_takes_no_plan_ends_it(state):
    check = patient(1)
    check.offer(proposal())
    check.tick(State.RUN, standing())
    for playback in (standing(), None):
        if check.is_busy:
            found, ticks = verdict_of(check, playback, state)
            assert (found.reason, ticks) == (Reason.NOT_CUEING, 1)
    check.offer(proposal())
    assert check.tick(State.RUN, None)[1].reason is Reason.NOT_CUEING


def test_too_many_that_wait():
    playback = standing()
    for number in range(MOST_PENDING):
        plan = proposal(0.1 if number == 0 else 0.01, number + 2, number + 1, goal=np.zeros(6))
        found = accept_proposal(compact(), plan, playback.newest, playback.newest_clock, HOMES)
        playback = follow(playback, found)
    check = patient(1)
    check.offer(proposal(plan_id=9, parent_id=MOST_PENDING + 1))
    found, ticks = verdict_of(check, playback)
    assert (found.reason, ticks) == (Reason.TOO_EARLY, 1)


def test_the_newest_waits_and_the_one_under_way_ends_first():
    check = patient(1)
    first, second, third = (proposal(plan_id=number) for number in (2, 3, 4))
    check.offer(first)
    check.tick(State.RUN, standing())
    assert not check.offer(second)
    assert check.offer(third)
    order = []
    for _ in range(40):
        found = check.tick(State.RUN, standing())
        if found is not None:
            order.append(found[0])
            assert isinstance(found[1], AcceptedPlan)
    assert order == [first, third]


def test_a_check_that_raises_is_forgotten():
    check, plan = patient(1), proposal()
    spoilt = Plan(2, 1, 0.1, plan.times, plan.pose, plan.velocity, plan.acceleration)
    object.__setattr__(spoilt, "pose", "nonsense")
    check.offer(spoilt)
    with pytest.raises((AttributeError, TypeError, ValueError)):
        verdict_of(check, standing())
    assert not check.is_busy
    check.offer(plan)
    found, _ = verdict_of(check, standing())
    assert isinstance(found, AcceptedPlan)
