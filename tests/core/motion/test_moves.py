from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from machines import compact, science_fit
from own_kinematics import lengths, quintic_poses

from motionserver.core.limits import Pace
from motionserver.core.motion.moves import SHORTEST, rest_to_rest, straight_way, straight_ways

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


def extremes():
    """Largest first, second and third derivative of the quintic from rest to rest on [0, 1]."""
    quintic = np.polynomial.Polynomial([0, 0, 0, 10, -15, 6])
    at = np.linspace(0.0, 1.0, 2_000_001)
    return [np.abs(quintic.deriv(order)(at)).max() for order in (1, 2, 3)]


SLACK = 1e12
HALF = np.zeros(6), np.array([0.05, -0.04, -0.08, 0.1, 0.12, -0.15])


@pytest.mark.parametrize("binding", ["speed", "acceleration", "jerk"])
@pytest.mark.parametrize(("start", "goal"), [HALF, HALF[::-1]], ids=["there", "back"])
def test_the_duration_is_the_chain_rules_bound(binding, start, goal):
    pace = replace(Pace(SLACK, SLACK, SLACK), **{binding: 0.01})
    way = straight_way(replace(compact(), pace=pace), start, goal)
    legs = lengths(compact(), start + np.linspace(0.0, 1.0, 65)[:, None] * (goal - start))
    l1, l2, l3 = (np.abs(np.diff(legs, order, axis=0)).max() * 64**order for order in (1, 2, 3))
    rate, bend, snap = extremes()
    bounds = {
        "speed": rate * l1 / 0.01,
        "acceleration": ((bend * l1 + rate**2 * l2) / 0.01) ** (1 / 2),
        "jerk": ((snap * l1 + 3 * rate * bend * l2 + rate**3 * l3) / 0.01) ** (1 / 3),
    }
    assert way.duration == pytest.approx(bounds[binding], rel=1e-7)


def test_the_slowest_of_the_three_decides():
    start, goal = HALF
    alone = [
        straight_way(
            replace(compact(), pace=replace(Pace(SLACK, SLACK, SLACK), **one)), start, goal
        )
        for one in ({"speed": 0.15}, {"acceleration": 0.5}, {"jerk": 2.0})
    ]
    together = straight_way(replace(compact(), pace=Pace(0.15, 0.5, 2.0)), start, goal)
    assert together.duration == max(way.duration for way in alone)


def test_several_ways_at_once_are_the_same_ways():
    goals = np.array([HALF[1], -0.5 * HALF[1], np.zeros(6)])
    for way, goal in zip(straight_ways(compact(), HALF[1] / 3, goals), goals, strict=True):
        alone = straight_way(compact(), HALF[1] / 3, goal)
        assert np.array_equal(way.poses, alone.poses)
        assert way.legs == pytest.approx(alone.legs, abs=1e-15)
        assert way.duration == pytest.approx(alone.duration, rel=1e-12)


def test_a_short_way_takes_its_time():
    assert SHORTEST == 0.5
    assert straight_way(compact(), np.zeros(6), np.zeros(6)).duration == SHORTEST
    assert straight_way(compact(), np.zeros(6), np.full(6, 1e-6)).duration == SHORTEST
