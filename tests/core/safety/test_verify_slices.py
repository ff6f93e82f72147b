"""The check in slices: where it rests, and that it says to the bit what the whole check says."""

from dataclasses import replace

import numpy as np
import pytest
from machines import compact
from verify_scenes import BARE, STANDING, ZERO, hop

from motionserver.core.axes import frozen
from motionserver.core.plan import Plan, rest_at
from motionserver.core.safety.slices import whole
from motionserver.core.safety.verdict import Reason
from motionserver.core.safety.verify import (
    check_legs,
    check_legs_in_slices,
    judge_in_slices,
)

HOMES = np.stack((ZERO, compact().parked_pose))
GENTLE = hop(np.array([0.05, 0.0, 0.0, 0.0, 0.0, 0.0]), 2.0)
QUICK = hop(np.array([0.05, -0.03, 0.08, 0.05, 0.04, -0.1]), 0.5)


def rests(slices):
    """How often it rests, and its result."""
    count = 0
    while True:
        try:
            next(slices)
        except StopIteration as done:
            return count, done.value
        count += 1


def judged(plan, block, machine=None):
    return rests(judge_in_slices(machine or compact(), plan, STANDING, None, BARE, HOMES, block))


def test_it_rests_after_each_part_and_twice_before_the_ways_home():
    assert judged(GENTLE, None) == (4, None)


def test_it_rests_after_every_block_as_well():
    # 3 samples before the hand-over, 1001 of the motion, 3 after its end
    assert judged(GENTLE, 512) == (4 + 2, None)
    assert judged(GENTLE, 100) == (4 + 10, None), "seven that are left are no block"


def test_what_is_malformed_is_refused_without_a_rest():
    rejected = judged(replace(GENTLE, times=frozen([0.0, 5.0])), 512)
    assert (rejected[0], rejected[1].reason) == (0, Reason.MALFORMED)


def largest_jerk(plan):
    """As the check computes it."""
    machine = replace(compact(), leg_jerk=1e-9, leg_speed=1e6, leg_acceleration=1e6)
    return check_legs(machine, plan, STANDING, None, BARE).value


def test_jerk_above_65_percent_of_its_limit_is_looked_at_again_in_blocks():
    largest = largest_jerk(GENTLE)
    limit = largest / 0.65
    while limit * 0.65 != largest:
        limit = np.nextafter(limit, 0.0 if limit * 0.65 > largest else np.inf)
    assert judged(GENTLE, 512, replace(compact(), leg_jerk=float(limit))) == (4 + 2, None)
    # twice as many samples less one: 2007
    below = replace(compact(), leg_jerk=float(limit) * 0.9999)
    assert judged(GENTLE, 512, below) == (4 + 2 + 4, None)


def cut(plan, at, number):
    """What is left of a plan at an instant, as its child."""
    later = plan.times[plan.times > at + 1e-3]
    times = np.concatenate(([at], later))
    rows = (frozen(part) for part in plan.evaluate(times))
    return Plan(number, plan.plan_id, at, frozen(times - at), *rows)


@pytest.mark.parametrize("block", [16, 100, 512])
@pytest.mark.parametrize("takeover", [0.003, 0.004, 0.2])
def test_a_motion_that_is_handed_over_passes_in_slices_as_in_one(block, takeover):
    """The samples before the hand-over are those of the plans before it."""
    second = cut(QUICK, 0.1, 2)
    third = cut(second, takeover, 3)
    given = (compact(), third, second, QUICK)
    tight = replace(compact(), leg_jerk=None, leg_acceleration=5.0, leg_speed=0.5)
    assert check_legs(*given, BARE) is whole(check_legs_in_slices(*given, BARE, block))
    for machine in (
        replace(tight, leg_max=1.05),
        replace(tight, leg_min=1.03),
        tight,
        replace(tight, leg_speed=0.01),
        replace(compact(), leg_jerk=1e-3, leg_acceleration=1e3, leg_speed=9.0),
        replace(compact(), passenger_acceleration=0.1),
        replace(compact(), joint_angle=0.01),
    ):
        given = (machine, third, second, QUICK)
        found = whole(check_legs_in_slices(*given, BARE, block))
        assert found is not None
        assert found == check_legs(*given, BARE)


def test_a_hand_over_within_the_blocks_shows_no_jump():
    """It rests far from neutral: rows that are not filled in would stand out."""
    there = np.array([0.05, 0.03, 0.05, 0.0, 0.02, 0.05])
    standing, plan = rest_at(there), hop(there, 0.5, start=there)
    for block in (16, 100, 512):
        found = check_legs_in_slices(compact(), plan, standing, None, BARE, block)
        assert rests(found)[1] is None
