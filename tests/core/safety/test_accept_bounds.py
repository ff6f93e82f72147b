"""Acceptance at its edges: instants, how far a rest is drawn, what another guard accepted."""

from dataclasses import replace

import numpy as np
import pytest
from machines import compact

from motionserver.core.axes import frozen
from motionserver.core.motion.moves import rest_to_rest, straight_way
from motionserver.core.plan import rest_at
from motionserver.core.safety.accept import (
    accept_again,
    accept_move,
    accept_proposal,
    accept_rest,
)
from motionserver.core.safety.verdict import AcceptedPlan, Reason, Rejection

ZERO = frozen(np.zeros(6))
HOMES = np.stack((ZERO, compact().parked_pose))
STANDING = accept_rest(compact(), ZERO, 1, HOMES)
GOAL = frozen([0.0, 0.0, -0.05, 0.0, 0.02, 0.0])


def proposal(takeover, plan_id=2):
    return rest_to_rest(plan_id, 1, takeover, ZERO, GOAL, 1.0)


def accepted(plan, clock, parent=STANDING):
    return accept_proposal(compact(), plan, parent, clock, HOMES)


def test_half_a_second_ahead_is_the_most():
    assert isinstance(accepted(proposal(0.5), 0.0), AcceptedPlan)
    found = accepted(proposal(0.625), 0.0625)
    assert found == Rejection(Reason.TOO_EARLY, None, None, 0.625, 0.5625)


def test_what_comes_too_late_is_told_what_would_have_been_early_enough():
    found = accepted(proposal(0.25), 0.5)
    assert found == Rejection(Reason.TOO_LATE, None, None, 0.25, 0.5)
    child = replace(proposal(0.002, 3), parent_id=2)
    waiting = accepted(proposal(0.1), 0.0)
    found = accepted(child, -0.05, waiting)
    assert found == Rejection(Reason.TOO_LATE, None, None, 0.002, 0.003)


def test_the_way_home_is_the_longer_of_the_two():
    found = accepted(proposal(0.1), 0.0)
    ways = [straight_way(compact(), GOAL, home).duration for home in HOMES]
    assert min(ways) < max(ways)
    assert found.way_home == pytest.approx(max(ways), rel=1e-12)


def highest():
    """The highest pose above neutral at which the guard accepts to stand [m], within a micron."""
    low, high = 0.15, 0.25
    while high - low > 1e-6:
        middle = (low + high) / 2
        found = accept_rest(compact(), frozen([0, 0, middle, 0, 0, 0]), 9, HOMES)
        low, high = (middle, high) if isinstance(found, AcceptedPlan) else (low, middle)
    return low


@pytest.mark.parametrize(
    ("outside", "share"), [(0.0, 0.0), (0.004, 0.005), (0.008, 0.01), (0.015, 0.02), (0.04, 0.05)]
)
def test_a_rest_is_drawn_inside_by_the_least_of_five_shares(outside, share):
    pose = frozen([0.0, 0.0, highest() * (1.0 + outside), 0.0, 0.0, 0.0])
    found = accept_rest(compact(), pose, 9, HOMES, reach=1.0)
    assert found.plan.rest_pose == pytest.approx(pose * (1.0 - share), abs=1e-15)
    assert found.plan.plan_id == 9


def test_a_rest_is_never_drawn_by_more_than_a_twentieth():
    pose = frozen([0.0, 0.0, highest() * 1.06, 0.0, 0.0, 0.0])
    assert accept_rest(compact(), pose, 9, HOMES, reach=1.0).reason is Reason.LEG_LENGTH


def test_no_leg_is_drawn_further_than_the_reach():
    pose = frozen([0.0, 0.0, highest() * 1.004, 0.001, 0.0, 0.0])
    legs = straight_way(compact(), pose, np.zeros(6)).legs
    drawn = min(share for share in (0.005, 0.01, 0.02, 0.05) if accepts(pose, share * moved(legs)))
    assert not accepts(pose, np.nextafter(drawn * moved(legs), 0.0))


def moved(legs):
    """How far the leg that moves most has to neutral [m]."""
    return float(np.max(np.abs(legs[0] - legs[-1])))


def accepts(pose, reach):
    return isinstance(accept_rest(compact(), pose, 9, HOMES, reach), AcceptedPlan)


def test_a_move_may_not_begin_before_its_parent_rests():
    found = accept_move(compact(), STANDING, 0.0078125, GOAL, 5, HOMES)
    assert found == Rejection(Reason.NOT_AT_REST, None, None, 0.0078125, 0.01)
    moved_there = accept_move(compact(), STANDING, 2.0, GOAL, 5, HOMES)
    assert (moved_there.plan.plan_id, moved_there.plan.parent_id) == (5, 1)
    assert moved_there.plan.takeover == 2.0
    assert moved_there.before is STANDING.plan


def test_what_another_guard_accepted_is_accepted_again():
    rest = rest_at(GOAL, 4)
    found = accept_again(compact(), rest, None, HOMES)
    assert found.plan is rest
    assert found.before is None
    plan = proposal(0.1)
    found = accept_again(compact(), plan, STANDING.plan, HOMES)
    assert found.plan is plan
    assert found.before is STANDING.plan


def test_a_move_of_another_guard_may_be_longer_than_a_cue():
    slow = rest_to_rest(5, 1, 0.1, ZERO, GOAL, 30.0)
    assert isinstance(accept_again(compact(), slow, STANDING.plan, HOMES), AcceptedPlan)
    endless = rest_to_rest(5, 1, 0.1, ZERO, GOAL, 61.0)
    for before in (STANDING.plan, None):
        found = accept_again(compact(), endless, before, HOMES)
        assert found == Rejection(Reason.MALFORMED, value=61.0, allowed=60.0)


def broken(plan):
    return replace(plan, pose=frozen(np.full_like(plan.pose, np.nan)))


def test_nothing_of_what_is_left_is_believed_unseen():
    plan = proposal(0.1)
    for bad, before in ((broken(plan), STANDING.plan), (plan, broken(STANDING.plan))):
        assert accept_again(compact(), bad, before, HOMES).reason is Reason.NOT_FINITE
    assert accept_again(compact(), broken(plan), None, HOMES).reason is Reason.NOT_FINITE
    elsewhere = rest_at(frozen([0.01, 0, 0, 0, 0, 0]), 1)
    assert accept_again(compact(), plan, elsewhere, HOMES).reason is Reason.DISCONTINUOUS
    lopsided = replace(plan, velocity=frozen(np.zeros((3, 6))))
    assert accept_again(compact(), lopsided, STANDING.plan, HOMES).reason is Reason.MALFORMED
    narrow = replace(plan, pose=frozen(np.zeros((2, 5))))
    assert accept_again(compact(), narrow, STANDING.plan, HOMES).reason is Reason.MALFORMED
    far = rest_to_rest(2, 1, 0.1, ZERO, frozen([0.5, 0, 0, 0, 0, 0]), 4.0)
    assert accept_again(compact(), far, STANDING.plan, HOMES).reason is Reason.LEG_LENGTH
