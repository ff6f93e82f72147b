from dataclasses import replace

import numpy as np
import pytest
from machines import compact
from proposals import goals

from motionserver.core.axes import frozen
from motionserver.core.motion.moves import rest_to_rest
from motionserver.core.safety.accept import accept_move, accept_proposal, accept_rest, untimely
from motionserver.core.safety.verdict import AcceptedPlan, Reason, Rejection
from motionserver.cueing.governor import remainder

ZERO = frozen(np.zeros(6))
HOMES = np.stack((ZERO, compact().parked_pose))
STANDING = accept_rest(compact(), ZERO, 1, HOMES)


def proposal(takeover=0.1, plan_id=2, parent_id=1, goal=(0.05, 0.0, 0.0, 0.0, 0.0, 0.0)):
    return rest_to_rest(plan_id, parent_id, takeover, ZERO, frozen(goal), 1.0)


def reason(plan, clock=0.05, parent=STANDING):
    found = accept_proposal(compact(), plan, parent, clock, HOMES)
    return None if isinstance(found, AcceptedPlan) else found.reason


def test_a_good_proposal():
    found = accept_proposal(compact(), proposal(), STANDING, 0.05, HOMES)
    assert isinstance(found, AcceptedPlan)
    assert found.before is STANDING.plan
    assert 0.5 < found.way_home < 10.0


@pytest.mark.parametrize("parent_id", [0, 3, 2**64 - 1])
def test_a_strangers_child(parent_id):
    assert reason(proposal(parent_id=parent_id)) is Reason.WRONG_PARENT


def test_its_own_parent():
    assert reason(proposal(plan_id=1)) is Reason.WRONG_PARENT


def test_instants_of_the_hand_over():
    assert reason(proposal(0.05)) is None
    assert reason(proposal(np.nextafter(0.05, 0))) is Reason.TOO_LATE
    assert reason(proposal(-1e9)) is Reason.TOO_LATE
    assert reason(proposal(0.55)) is None
    assert reason(proposal(0.5501)) is Reason.TOO_EARLY
    assert reason(proposal(1e308)) is Reason.TOO_EARLY
    assert reason(proposal(0.0), clock=0.0) is None
    assert reason(proposal(-1e-9), clock=-0.1) is Reason.TOO_LATE
    for wild in (np.nan, np.inf, -np.inf):
        assert reason(proposal(wild)) is Reason.NOT_FINITE


@pytest.mark.parametrize("wild", [np.nan, np.inf, -np.inf])
def test_an_instant_that_is_no_number_is_untimely_by_itself(wild):
    assert untimely(proposal(wild), STANDING, 0.05) == Rejection(Reason.NOT_FINITE)


def test_a_child_of_a_waiting_plan():
    first = accept_proposal(compact(), proposal(), STANDING, 0.05, HOMES)
    child = remainder(first.plan, 0.003, 3)
    assert reason(child, -0.05, first) is None
    assert reason(replace(child, takeover=0.0029), -0.05, first) is Reason.TOO_LATE
    assert reason(replace(child, takeover=0.4501), -0.05, first) is Reason.TOO_EARLY


def test_a_rest_where_it_stands():
    pose = frozen([0.01, 0.02, -0.03, 0.02, 0.01, 0.0])
    found = accept_rest(compact(), pose, 9, HOMES)
    assert isinstance(found, AcceptedPlan)
    assert (found.plan.rest_pose == pose).all()
    assert found.before is None


@pytest.mark.parametrize(
    ("heave", "reach", "accepted"),
    [(0.1995, 0.0, True), (0.1999, 0.0, False), (0.1999, 0.005, True), (0.25, 0.005, False)],
)
def test_a_rest_may_be_drawn_inside_by_a_hair(heave, reach, accepted):
    pose = frozen([0.0, 0.0, heave, 0.0, 0.0, 0.0])
    found = accept_rest(compact(), pose, 9, HOMES, reach)
    assert isinstance(found, AcceptedPlan) is accepted
    if not accepted:
        assert found.reason is Reason.LEG_LENGTH


def test_a_rest_at_neutral_that_cannot_be():
    machine = replace(compact(), leg_min=1.1)
    assert accept_rest(machine, ZERO, 9, HOMES, 0.005).reason is Reason.LEG_LENGTH
    stranded = frozen(goals(compact())["stranded"][0])
    assert accept_rest(compact(), stranded, 9, HOMES, 0.0).reason is Reason.NO_WAY_HOME
    assert accept_rest(compact(), ZERO * np.nan, 9, HOMES).reason is Reason.NOT_FINITE


def test_moves():
    goal = frozen([0.0, 0.0, -0.15, 0.0, 0.0, 0.0])
    found = accept_move(compact(), STANDING, 0.01, goal, 5, HOMES)
    assert isinstance(found, AcceptedPlan)
    assert (found.plan.rest_pose == goal).all()
    early = accept_move(compact(), STANDING, 0.009, goal, 5, HOMES)
    assert early.reason is Reason.NOT_AT_REST
    far = accept_move(compact(), STANDING, 0.01, goal * 2, 5, HOMES)
    assert far.reason is Reason.LEG_LENGTH
    stranded = frozen(goals(compact())["stranded"][0])
    assert accept_move(compact(), STANDING, 0.01, stranded, 5, HOMES).reason is Reason.NO_WAY_HOME
    hasty = replace(compact(), leg_speed=0.1)
    assert accept_move(hasty, STANDING, 0.01, goal, 5, HOMES).reason is Reason.LEG_SPEED
    slow = replace(compact(), pace=replace(compact().pace, speed=1e-3))
    assert accept_move(slow, STANDING, 0.01, goal, 5, HOMES).reason is Reason.MALFORMED


def test_what_verification_refuses_is_not_accepted():
    assert reason(proposal(goal=(0.5, 0.0, 0.0, 0.0, 0.0, 0.0))) is Reason.LEG_LENGTH
