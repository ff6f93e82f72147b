from dataclasses import replace

import numpy as np
import pytest
from machines import compact, science_fit
from own_kinematics import lengths, quintic_poses
from proposals import goals
from verify_scenes import BARE, STANDING, ZERO, hop, reason

from motionserver.core.axes import frozen
from motionserver.core.kinematics.hexapod import conditioning, joint_angles, neutral_conditioning
from motionserver.core.plan import Plan
from motionserver.core.safety.verdict import Reason, Rejection
from motionserver.core.safety.verify import (
    GUARD_MARGINS,
    PLANNER_MARGINS,
    check_ways_home,
    judge,
)


def largest(plan, machine, order):
    times = np.arange(0.0, plan.duration + 0.01, 0.002)
    legs = lengths(machine, quintic_poses(plan, np.concatenate(([0, 0, 0], times))))
    return np.abs(np.diff(legs, order, axis=0)).max() / 0.002**order


@pytest.mark.parametrize(
    ("order", "limit", "reason_", "share"),
    [
        (1, "leg_speed", Reason.LEG_SPEED, 0.995),
        (2, "leg_acceleration", Reason.LEG_ACCELERATION, 0.995),
        (3, "leg_jerk", Reason.LEG_JERK, 0.97),
    ],
)
def test_legs_are_differenced(order, limit, reason_, share):
    plan = hop(np.array([0.02, 0.01, 0.02, 0.0, 0.02, 0.0]), 0.7)
    found = largest(plan, compact(), order)
    loose = {"leg_speed": 1e3, "leg_acceleration": 1e4, "leg_jerk": None}
    machine = replace(compact(), **loose)
    assert reason(plan, machine) is None
    # the finer look at jerk near its limit may find a little more
    room = 1.06 if order == 3 else 1.0001
    assert reason(plan, replace(machine, **{limit: found / share * room})) is None
    rejection = judge(replace(machine, **{limit: found / share * 0.9999}), plan, STANDING, None)
    assert rejection is not None
    assert rejection.reason is reason_
    assert rejection.value == pytest.approx(found, rel=0.06 if order == 3 else 1e-6)
    assert rejection.value > rejection.allowed
    assert rejection.leg in range(6)
    assert 0.0 <= rejection.when <= plan.duration + 0.01
    assert str(rejection).startswith(f"plan rejected: {reason_}, leg {rejection.leg + 1}, at 0.")


@pytest.mark.parametrize("sign", [1, -1])
def test_the_stroke_has_two_ends(sign):
    machine = compact()
    goal = np.array([0.0, 0.0, sign * 0.1, 0.0, 0.0, 0.0])
    plan = hop(goal, 3.0)
    legs = lengths(machine, goal)[0]
    name, end = ("leg_max", legs.max()) if sign > 0 else ("leg_min", legs.min())
    homes = np.zeros((1, 6))
    inside = replace(machine, **{name: end + sign * 0.0002001})
    assert reason(plan, inside, homes=homes) is None
    outside = judge(replace(machine, **{name: end + sign * 0.0001999}), plan, STANDING, None)
    assert outside.reason is Reason.LEG_LENGTH
    assert (outside.value - outside.allowed) * sign > 0
    assert reason(plan, inside, PLANNER_MARGINS, homes=homes) is Reason.LEG_LENGTH


def test_joint_angle_and_conditioning_where_the_shipped_machine_has_them():
    machine, found = compact(), goals(compact())
    for aim, expected in (("swung", Reason.JOINT_ANGLE), ("singular", Reason.CONDITIONING)):
        for goal in found[aim][:10]:
            rejection = judge(machine, hop(goal, 4.0), STANDING, None)
            assert rejection.reason is expected
            assert 0.0 < rejection.when <= 4.01
            loose = replace(machine, joint_angle=None, conditioning=None)
            assert reason(hop(goal, 4.0), loose) in (None, Reason.NO_WAY_HOME)


def test_joint_angle_has_a_margin_at_its_limit():
    goal = np.array([0.05, 0.0, 0.0, 0.05, 0.0, 0.1])
    swing = joint_angles(compact(), goal[None]).max()
    for margins, kept in ((GUARD_MARGINS, 0.001), (PLANNER_MARGINS, 0.003)):
        wide = replace(compact(), joint_angle=swing + kept + 1e-6)
        assert reason(hop(goal, 2.0), wide, margins) is None
        tight = replace(compact(), joint_angle=swing + kept - 1e-6)
        assert reason(hop(goal, 2.0), tight, margins) is Reason.JOINT_ANGLE


def test_conditioning_has_a_margin_at_its_limit():
    goal = np.array([0.0, 0.0, -0.15, 0.0, 0.0, 0.0])
    ratio = conditioning(compact(), goal[None])[0] / neutral_conditioning(compact())
    homes = np.zeros((1, 6))
    wide = replace(compact(), joint_angle=None, conditioning=ratio / 1.01 - 1e-6)
    assert reason(hop(goal, 3.0), wide, homes=homes) is None
    tight = replace(wide, conditioning=ratio / 1.01 + 1e-6)
    assert reason(hop(goal, 3.0), tight, homes=homes) is Reason.CONDITIONING


def test_passengers_are_not_thrown():
    plan = hop(np.array([0.03, 0.04, 0.0, 0.0, 0.0, 0.0]), 0.5)
    found = 0.05 * 5.7735 / 0.25
    kind = replace(compact(), passenger_acceleration=found / 0.995 * 1.001)
    assert reason(plan, kind) is None
    rough = judge(replace(compact(), passenger_acceleration=found * 0.999), plan, STANDING, None)
    assert rough.reason is Reason.PASSENGER
    assert rough.value == pytest.approx(found, rel=1e-3)


def test_poses_without_a_way_home():
    stranded = goals(compact())["stranded"]
    assert len(stranded) > 50
    for goal in stranded[:20]:
        plan = hop(goal, 4.0)
        assert reason(plan, homes=np.zeros((1, 6))) is None
        assert reason(plan) is Reason.NO_WAY_HOME


def test_the_way_home_is_judged_by_all_rules():
    machine, goal = compact(), np.array([0.0, 0.0, 0.1, 0.0, 0.0, 0.0])
    homes = np.stack((ZERO, machine.parked_pose))
    assert check_ways_home(machine, goal, homes, GUARD_MARGINS) is None
    # the swing is largest at the far end, the parked pose, which few samples would miss
    swing = joint_angles(machine, machine.parked_pose[None]).max()
    tight = replace(machine, joint_angle=swing)
    found = check_ways_home(tight, goal, homes, GUARD_MARGINS)
    assert found.reason is Reason.NO_WAY_HOME
    slow = replace(machine, pace=replace(machine.pace, speed=0.003))
    found = check_ways_home(slow, goal, homes, GUARD_MARGINS)
    assert found.reason is Reason.NO_WAY_HOME
    assert found.value > found.allowed == 60.0


@pytest.mark.parametrize("takeover", [0.003, 0.004, 0.0055, 0.02])
def test_samples_before_the_hand_over_belong_to_parent_and_grandparent(takeover):
    """A motion cut into three plans passes as the whole does, with no step at its seams."""
    machine = compact()
    whole = replace(hop(np.array([0.03, 0.0, 0.03, 0.0, 0.05, 0.0]), 0.8), takeover=0.0)

    def rest_of(plan, at, own):
        later = plan.times[plan.times > at + 1e-3]
        rows = (frozen(part) for part in plan.evaluate(np.concatenate(([at], later))))
        times = frozen(np.concatenate(([at], later)) - at)
        return Plan(own, plan.plan_id, at, times, *rows)

    second = rest_of(whole, 0.4, 2)
    third = rest_of(second, takeover, 3)
    assert judge(machine, second, whole, STANDING, BARE) is None
    assert judge(machine, third, second, whole, BARE) is None
    assert judge(machine, third, second, whole, replace(BARE, jerk_share=0.001)).reason


def test_another_machine_is_judged_by_its_own_limits():
    plan = hop(np.array([0.0, 0.0, 0.15, 0.0, 0.0, 0.0]), 3.0)
    assert reason(plan, science_fit()) is None
    assert reason(plan, replace(science_fit(), leg_max=0.85)) is Reason.LEG_LENGTH


def test_a_rejection_speaks():
    assert str(Rejection(Reason.WRONG_PARENT)) == "plan rejected: wrong-parent"
    text = str(Rejection(Reason.LEG_SPEED, 0.5, 2, 0.7, 0.6))
    assert text == "plan rejected: leg-speed, leg 3, at 0.500 s, found 0.7, allowed 0.6"
    assert str(Rejection(Reason.MALFORMED, value=3.0)) == "plan rejected: malformed"
