import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from machines import compact, science_fit
from own_kinematics import lengths, quintic_poses

from motionserver.core.motion.moves import SHORTEST, rest_to_rest, straight_way

ends = st.lists(st.floats(-0.6, 0.6), min_size=12, max_size=12).map(np.array)


@pytest.mark.parametrize("machine", [compact(), science_fit()], ids=lambda m: m.name)
@given(ends)
def test_no_leg_exceeds_the_pace(machine, shares):
    start, goal = shares[:6] * machine.box, shares[6:] * machine.box
    way = straight_way(machine, start, goal)
    plan = rest_to_rest(1, 0, 0.0, start, goal, way.duration)
    h = way.duration / 500
    times = np.arange(-3, 504) * h
    moved = lengths(machine, quintic_poses(plan, np.maximum(times, 0.0)))
    for limit in (machine.pace.speed, machine.pace.acceleration, machine.pace.jerk):
        moved = np.diff(moved, axis=0) / h
        assert np.abs(moved).max() <= limit * 1.001


def test_the_way_is_straight_and_starts_and_ends_right():
    start, goal = np.zeros(6), np.array([0.1, 0.0, -0.1, 0.0, 0.1, 0.0])
    way = straight_way(compact(), start, goal)
    assert way.poses[0] == pytest.approx(start)
    assert way.poses[-1] == pytest.approx(goal)
    assert np.ptp(np.diff(way.poses, axis=0), axis=0) == pytest.approx(np.zeros(6))
    assert way.legs == pytest.approx(lengths(compact(), way.poses), abs=1e-13)


def test_a_short_way_takes_its_time():
    assert straight_way(compact(), np.zeros(6), np.zeros(6)).duration == SHORTEST
    assert straight_way(compact(), np.zeros(6), np.full(6, 1e-6)).duration == SHORTEST
