from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motionserver.core.axes import frozen
from motionserver.core.motion.moves import rest_to_rest
from motionserver.core.motion.player import MOST_PENDING, Playback, advance, follow, state_now
from motionserver.core.plan import rest_at
from motionserver.core.safety.verdict import AcceptedPlan

ZERO = np.zeros(6)


def accepted(plan_id, takeover, duration=1.0):
    goal = frozen(np.full(6, plan_id * 0.1))
    plan = rest_to_rest(plan_id, plan_id - 1, takeover, ZERO, goal, duration)
    return AcceptedPlan(plan, None, 1.0)


def test_one_plan():
    playback = Playback(AcceptedPlan(rest_at(ZERO), None, 1.0))
    assert not playback.is_at_rest
    assert playback.remaining == pytest.approx(0.01)
    later = advance(playback, 0.5)
    assert later.is_at_rest
    assert later.remaining == 0.0
    assert later.newest is playback.playing
    assert later.newest_clock == 0.5


def test_exactly_at_its_end_a_plan_rests_and_exactly_at_its_instant_the_next_begins():
    playback = Playback(AcceptedPlan(rest_at(ZERO), None, 1.0), 0.01)
    assert playback.is_at_rest
    waiting = follow(replace(playback, clock=0.25), accepted(1, 0.5))
    assert advance(waiting, 0.125).playing is playback.playing
    at = advance(waiting, 0.25)
    assert (at.playing.plan.plan_id, at.clock, at.pending) == (1, 0.0, ())


def test_three_plans_may_wait():
    assert MOST_PENDING == 3


def test_plans_take_over_at_their_instants():
    playback = Playback(AcceptedPlan(rest_at(ZERO), None, 1.0), 0.2)
    for plan_id, takeover in ((1, 0.3), (2, 0.05), (3, 0.4)):
        playback = follow(playback, accepted(plan_id, takeover))
    assert playback.newest.plan.plan_id == 3
    assert playback.newest_clock == pytest.approx(0.2 - 0.3 - 0.05 - 0.4)
    assert playback.remaining == pytest.approx(1.55)
    assert not playback.is_at_rest
    before = advance(playback, 0.0999)
    assert before.playing.plan.plan_id == 0
    at = advance(playback, 0.1)
    assert at.playing.plan.plan_id == 1
    assert at.clock == pytest.approx(0.0)
    both = advance(playback, 0.25)
    assert (both.playing.plan.plan_id, len(both.pending)) == (2, 1)
    assert both.clock == pytest.approx(0.1)
    end = advance(both, 5.0)
    assert end.is_at_rest
    assert state_now(end).pose == pytest.approx(np.full(6, 0.3))


@given(st.lists(st.floats(0.0, 0.3), min_size=1, max_size=30))
def test_small_steps_and_one_large_one_end_at_the_same_place(steps):
    playback = Playback(AcceptedPlan(rest_at(ZERO), None, 1.0))
    for plan_id, takeover in ((1, 0.3), (2, 0.7), (3, 0.4)):
        playback = follow(playback, accepted(plan_id, takeover))
    once, often = advance(playback, sum(steps)), playback
    for step in steps:
        often = advance(often, step)
    if once.playing is often.playing:
        assert often.clock == pytest.approx(once.clock, abs=1e-12)
    assert often.newest_clock == pytest.approx(once.newest_clock, abs=1e-12)
    assert advance(playback, 0.0) == playback
