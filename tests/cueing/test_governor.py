import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from machines import compact

from motionserver.core.axes import frozen
from motionserver.core.motion.moves import rest_to_rest
from motionserver.core.plan import Plan, rest_at
from motionserver.core.safety.verdict import Reason, Rejection
from motionserver.core.safety.verify import GUARD_MARGINS, PLANNER_MARGINS, judge
from motionserver.cueing.base import Candidate
from motionserver.cueing.governor import KAPPAS, govern, remainder

ZERO = np.zeros(6)
GOAL = np.array([0.06, -0.03, 0.04, 0.05, 0.03, -0.05])
PARENT = rest_to_rest(3, 2, 0.0, frozen(ZERO), frozen(GOAL), 2.0)
NO = Rejection(Reason.LEG_SPEED)


def candidate(goal, duration=1.5, knots=8, start=None):
    state = start or PARENT.state(0.7)
    times = np.linspace(0.0, duration, knots)
    still = np.zeros(6)
    both = (
        np.stack((state.pose, goal)),
        np.stack((state.velocity, still)),
        np.stack((state.acceleration, still)),
    )
    line = Plan(0, 0, 0.0, frozen([0.0, duration]), *(frozen(table) for table in both))
    pose, velocity, acceleration = line.evaluate(times)
    velocity[-1] = acceleration[-1] = 0.0
    return Candidate(times, pose, velocity, acceleration)


@pytest.mark.parametrize("refused", range(len(KAPPAS) + 1))
def test_the_first_share_that_passes(refused):
    seen = []

    def check(plan):
        seen.append(plan)
        return NO if len(seen) <= refused else None

    found = govern(candidate(-GOAL), PARENT, 0.7, 9, check)
    assert found.kappa == (*KAPPAS, 0.0)[refused]
    assert found.refusals == (NO,) * refused
    assert len(seen) == min(refused + 1, len(KAPPAS))
    assert (found.plan.plan_id, found.plan.parent_id, found.plan.takeover) == (9, 3, 0.7)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=40)
def test_a_blend_agrees_at_the_hand_over_and_ends_at_rest(seed):
    rng = np.random.default_rng(seed)
    takeover = rng.uniform(0.003, 2.5)
    wish = candidate(
        rng.uniform(-1, 1, 6) * compact().box,
        rng.uniform(0.3, 3.9),
        int(rng.integers(2, 30)),
        PARENT.state(takeover),
    )
    plans = []
    govern(wish, PARENT, takeover, 9, lambda plan: plans.append(plan) or NO)
    here = PARENT.state(takeover)
    for kappa, plan in zip(KAPPAS, plans, strict=True):
        state = plan.state(0.0)
        assert state.pose == pytest.approx(here.pose, abs=1e-12)
        assert state.velocity == pytest.approx(here.velocity, abs=1e-12)
        assert state.acceleration == pytest.approx(here.acceleration, abs=1e-11)
        assert not plan.velocity[-1].any()
        assert not plan.acceleration[-1].any()
        middle = GOAL + kappa * (wish.pose[-1] - GOAL)
        assert plan.rest_pose == pytest.approx(middle, abs=1e-12)
        assert len(plan.times) <= 256


def test_without_a_candidate_the_accepted_plan_goes_on():
    found = govern(None, PARENT, 0.7, 9, lambda plan: NO)
    assert (found.kappa, found.refusals) == (0.0, ())


@given(st.floats(0.0, 3.0), st.integers(2, 20))
def test_the_remainder_is_the_same_motion(takeover, knots):
    times = np.linspace(0.0, 2.0, knots)
    tables = [np.array(table) for table in PARENT.evaluate(times)]
    tables[1][-1] = tables[2][-1] = 0.0
    parent = Plan(4, 3, 0.0, frozen(times), *(frozen(table) for table in tables))
    rest = remainder(parent, takeover, 5)
    instants = np.linspace(0.0, 2.5, 300)
    for mine, whole in zip(
        rest.evaluate(instants), parent.evaluate(takeover + instants), strict=True
    ):
        assert mine == pytest.approx(whole, abs=1e-4)
    assert rest.poses(instants) == pytest.approx(parent.poses(takeover + instants), abs=1e-9)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=25)
def test_the_remainder_of_what_the_planner_passed_passes_the_guard(seed):
    rng = np.random.default_rng(seed)
    start = rest_at(ZERO, 1)
    found = govern(
        candidate(rng.uniform(-1, 1, 6) * compact().box, rng.uniform(0.3, 2.0), 12, start.state(0)),
        start,
        0.02,
        2,
        lambda plan: judge(compact(), plan, start, None, PLANNER_MARGINS),
    )
    chain = [start, found.plan]
    for number in range(3, 20):
        takeover = rng.uniform(0.003, 0.08)
        chain.append(remainder(chain[-1], takeover, number))
        before = chain[-3]
        assert judge(compact(), chain[-1], chain[-2], before, GUARD_MARGINS) is None


@pytest.mark.parametrize("excess", [1e-12, 1e-6, 0.004, 0.0079, 0.5])
def test_knots_never_come_too_close(excess):
    """The accepted plan ends a little after the candidate: one more knot, and not too near."""
    wish = candidate(ZERO, PARENT.duration - 0.7 - excess)
    found = govern(wish, PARENT, 0.7, 9, lambda plan: judge(compact(), plan, PARENT, None))
    assert found.kappa == 1.0
    assert found.plan.duration >= 1.3 - 1e-9
