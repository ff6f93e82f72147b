"""What a refusal of the check tells: which sample, which leg, how much, against what."""

from dataclasses import asdict, replace

import numpy as np
import pytest
from machines import compact
from own_kinematics import lengths, quintic_poses
from verify_scenes import BARE, STANDING, ZERO, hop

from motionserver.core.axes import frozen
from motionserver.core.kinematics.hexapod import (
    conditioning,
    joint_angles,
    leg_lengths,
    neutral_conditioning,
)
from motionserver.core.motion.moves import straight_way, straight_ways
from motionserver.core.plan import Plan, rest_at
from motionserver.core.safety import verify
from motionserver.core.safety.verdict import Reason, Rejection
from motionserver.core.safety.verify import Margins, check_legs, check_ways_home

FREE = replace(
    compact(),
    leg_min=0.1,
    leg_max=9.0,
    leg_speed=1e6,
    leg_acceleration=1e6,
    leg_jerk=None,
    joint_angle=None,
    conditioning=None,
)
SKEW = np.array([0.05, -0.03, 0.08, 0.05, 0.04, -0.1])
QUICK = hop(SKEW, 0.5)
NEUTRAL = lengths(compact(), ZERO)[0]


def check(machine, plan, parent=STANDING, before=None, margins=BARE):
    return check_legs(replace(FREE, **machine), plan, parent, before, margins)


def grid(plan, step=0.002):
    """Sampled legs (N, 6), from three samples before the hand-over at rest to after the end."""
    times = np.arange(-3, int(np.ceil(plan.duration / step)) + 4) * step
    return lengths(compact(), quintic_poses(plan, np.maximum(times, 0.0)))


def test_the_documented_numbers():
    assert (verify.GRID, verify.CLOSEST, verify.AHEAD, verify.LONGEST_MOVE) == (
        0.002, 0.003, 0.5, 60.0,
    )  # fmt: skip
    shares = ("stroke", "share", "jerk_share", "swing", "conditioning")
    guard, planner = (0.0002, 0.995, 0.97, 0.001, 1.01), (0.0005, 0.98, 0.94, 0.003, 1.03)
    assert (
        asdict(Margins()) == asdict(verify.GUARD_MARGINS) == dict(zip(shares, guard, strict=True))
    )
    assert asdict(verify.PLANNER_MARGINS) == dict(zip(shares, planner, strict=True))


@pytest.mark.parametrize("duration", [0.5, 20.0])
@pytest.mark.parametrize("end", ["leg_min", "leg_max"])
def test_the_first_sample_outside_the_stroke_is_told(duration, end):
    plan = hop(-SKEW if end == "leg_min" else SKEW, duration)
    step = max(0.002, duration / 2000)
    legs, room = grid(plan, step), 0.02
    if end == "leg_min":
        limit = NEUTRAL.min() - room
        rows, short = np.nonzero(legs < limit + 0.001)
        allowed = limit + 0.001
    else:
        limit = NEUTRAL.max() + room
        rows, short = np.nonzero(legs > limit - 0.001)
        allowed = limit - 0.001
    found = check({end: limit}, plan, margins=replace(BARE, stroke=0.001))
    assert found.reason is Reason.LEG_LENGTH
    assert found.when == pytest.approx((rows[0] - 3) * step, abs=1e-12)
    assert found.leg == short[0]
    assert found.value == pytest.approx(legs[rows[0], short[0]], abs=1e-12)
    assert found.allowed == pytest.approx(allowed, abs=1e-15)


@pytest.mark.parametrize(
    ("order", "limit", "reason", "share"),
    [
        (1, "leg_speed", Reason.LEG_SPEED, "share"),
        (2, "leg_acceleration", Reason.LEG_ACCELERATION, "share"),
        (3, "leg_jerk", Reason.LEG_JERK, "jerk_share"),
    ],
)
@pytest.mark.parametrize("plan", [QUICK, hop(-SKEW, 0.7)], ids=["up", "down"])
def test_the_worst_sample_and_leg_are_told(order, limit, reason, share, plan):
    moved = np.abs(np.diff(grid(plan), order, axis=0)) / 0.002**order
    row, leg = np.unravel_index(moved.argmax(), moved.shape)
    # half of what is found: no doubt that asks for a finer look at the jerk
    found = check({limit: moved.max()}, plan, margins=replace(BARE, **{share: 0.5}))
    assert found.reason is reason
    assert found.when == pytest.approx(max(0.0, (row + order - 3) * 0.002), abs=1e-12)
    assert found.leg == leg
    assert found.value == pytest.approx(moved.max(), rel=1e-6)
    assert found.allowed == pytest.approx(moved.max() / 2)


def test_doubtful_jerk_is_looked_at_twice_as_finely():
    coarse = (np.abs(np.diff(grid(QUICK), 3, axis=0)) / 0.002**3).max()
    times = np.arange(-3, 504) * 0.001
    legs = lengths(compact(), quintic_poses(QUICK, np.maximum(times, 0.0)))
    fine = np.abs(np.diff(legs, 3, axis=0)) / 0.001**3
    assert fine.max() > 1.01 * coarse
    row, leg = np.unravel_index(fine.argmax(), fine.shape)
    found = check({"leg_jerk": coarse * 1.001}, QUICK)
    assert (found.reason, found.leg) == (Reason.LEG_JERK, leg)
    assert found.value == pytest.approx(fine.max(), rel=1e-6)
    assert found.when == pytest.approx((row + 3 - 3) * 0.001, abs=1e-12)
    assert check({"leg_jerk": fine.max() * 1.0001}, QUICK) is None
    # beyond the limit already at the first look: that is what is told
    assert check({"leg_jerk": coarse * 0.999}, QUICK).value == pytest.approx(coarse, rel=1e-6)


def at_edge(order):
    """Largest leg difference of the order, to the last bit as the check computes it."""
    times = np.arange(int(np.ceil(QUICK.duration / 0.002)) + 4) * 0.002
    moved = leg_lengths(compact(), np.vstack((np.zeros((3, 6)), QUICK.poses(times))))
    for _ in range(order):
        moved = np.diff(moved, axis=0) / 0.002
    return float(np.abs(moved).max())


@pytest.mark.parametrize(("order", "limit"), [(1, "leg_speed"), (2, "leg_acceleration")])
def test_exactly_the_limit_is_allowed(order, limit):
    edge = at_edge(order)
    assert check({limit: edge}, QUICK) is None
    assert check({limit: np.nextafter(edge, 0.0)}, QUICK) is not None


def test_jerk_exactly_at_the_limit_is_doubtful_and_exactly_the_limit_when_seen_finely_is_allowed():
    assert check({"leg_jerk": at_edge(3)}, QUICK).value > at_edge(3)
    fine = check({"leg_jerk": at_edge(3)}, QUICK).value
    assert check({"leg_jerk": fine}, QUICK) is None


def test_exactly_the_ends_of_the_stroke_are_allowed():
    legs = leg_lengths(compact(), np.zeros((1, 6)))
    low, high = float(legs.min()), float(legs.max())
    assert check({"leg_min": low, "leg_max": high}, STANDING) is None
    assert check({"leg_min": np.nextafter(low, 9.0)}, STANDING) is not None
    assert check({"leg_max": np.nextafter(high, 0.0)}, STANDING) is not None


def test_what_happened_before_the_hand_over_is_told_as_its_beginning():
    down = Plan(0, 0, 0.0, *map(frozen, ([0.0, 1.0], [ZERO - 0.2, ZERO], [ZERO] * 2, [ZERO] * 2)))
    plan = replace(STANDING, takeover=0.008)
    found = check({"leg_min": NEUTRAL.min() - 0.01}, plan, parent=down)
    assert (found.reason, found.when) == (Reason.LEG_LENGTH, 0.0)
    # it falls to rest within the last sample before
    fall = Plan(
        0, 0, 0.0, *map(frozen, ([0.0, 0.002], [ZERO + 0.01, ZERO], [ZERO] * 2, [ZERO] * 2))
    )
    found = check({"leg_speed": 0.1}, replace(STANDING, takeover=0.006), parent=fall)
    assert (found.reason, found.when) == (Reason.LEG_SPEED, 0.0)


def outside_at_first():
    """Outside the stroke at its very first instant, at neutral from the next millisecond on."""
    pose = [[0.0, 0.0, 0.5, 0.0, 0.0, 0.0], ZERO]
    return Plan(0, 0, 0.0, *map(frozen, ([0.0, 0.001], pose, [ZERO] * 2, [ZERO] * 2)))


@pytest.mark.parametrize("takeover", [0.002, 0.004, 0.006])
def test_the_three_samples_before_a_hand_over_reach_the_first_instant_of_a_parent(takeover):
    stroke = {"leg_max": NEUTRAL.max() + 0.1}
    plan = replace(STANDING, takeover=takeover)
    seen = check(stroke, plan, parent=outside_at_first())
    assert seen.reason is Reason.LEG_LENGTH
    later = replace(STANDING, takeover=takeover + 0.002)
    assert (check(stroke, later, parent=outside_at_first()) is None) is (takeover == 0.006)


def test_the_samples_before_reach_the_first_instant_of_a_grandparent():
    stroke = {"leg_max": NEUTRAL.max() + 0.1}
    plan = replace(STANDING, takeover=0.002)
    for parent_takeover, is_seen in ((0.004, True), (0.006, False), (0.002, True)):
        parent = replace(STANDING, takeover=parent_takeover)
        found = check(stroke, plan, parent, outside_at_first())
        assert (found is not None) is is_seen


def test_one_sample_of_three_may_be_the_grandparents():
    parent = replace(STANDING, takeover=0.002)
    child = replace(STANDING, takeover=0.004)
    assert check({"leg_max": NEUTRAL.max() + 0.1}, child, parent, outside_at_first()) is not None


def test_the_worst_acceleration_of_a_passenger_is_told_and_turning_is_none():
    plan = hop(np.array([0.03, 0.04, 0.02, 0.3, 0.2, 0.1]), 0.6)
    times = np.arange(-3, 304) * 0.002
    moved = quintic_poses(plan, np.maximum(times, 0.0))[:, :3]
    second = np.linalg.norm(np.diff(moved, 2, axis=0), axis=1) / 0.002**2
    limit = second.max()
    found = check({"passenger_acceleration": limit}, plan, margins=replace(BARE, share=0.5))
    assert (found.reason, found.leg) == (Reason.PASSENGER, None)
    # it speeds up as hard as it slows down: which of the two is told is a matter of rounding
    worst = np.flatnonzero(second > limit * (1.0 - 1e-9))
    assert np.abs((worst + 2 - 3) * 0.002 - found.when).min() < 1e-12
    assert found.value == pytest.approx(limit, rel=1e-9)
    assert found.allowed == pytest.approx(limit / 2)
    exact = found.value
    assert check({"passenger_acceleration": exact}, plan) is None
    assert check({"passenger_acceleration": np.nextafter(exact, 0.0)}, plan) is not None


def swings(poses):
    return joint_angles(compact(), poses)


def test_the_worst_joint_of_every_sixteenth_sample_is_told():
    plan = hop(SKEW, 0.5)
    rows = [*range(0, 257, 16), 256]
    times = np.maximum((np.array(rows) - 3) * 0.002, 0.0)
    swing = swings(plan.poses(times))
    row, _, leg = np.unravel_index(swing.argmax(), swing.shape)
    found = check({"joint_angle": swing.max()}, plan, margins=replace(BARE, swing=0.01))
    assert found.reason is Reason.JOINT_ANGLE
    assert found.when == pytest.approx((rows[row] - 3) * 0.002)
    assert found.leg == leg
    assert found.value == pytest.approx(swing.max(), abs=1e-12)
    assert found.allowed == pytest.approx(swing.max() - 0.01)
    # on the way back the worst sample is one in the middle of the grid, or the first
    back = hop(ZERO, 0.5, start=SKEW)
    swing = swings(back.poses(times))
    found = check({"joint_angle": swing.max() - 1e-9}, back, parent=rest_at(SKEW))
    assert found.when == 0.0


def test_exactly_the_joint_angle_is_allowed():
    swing = float(swings(np.zeros((1, 6))).max())
    assert check({"joint_angle": swing}, STANDING) is None
    if swing > 0.0:
        assert check({"joint_angle": np.nextafter(swing, 0.0)}, STANDING) is not None


def ways(machine, rest=ZERO, homes=(ZERO,), margins=BARE):
    return check_ways_home(replace(FREE, **machine), rest, np.array(homes), margins)


def test_how_far_a_way_home_leads_outside_is_told():
    rest = np.array([0.0, 0.0, 0.1, 0.0, 0.0, 0.0])
    legs = straight_way(compact(), rest, ZERO).legs
    for machine, beyond in (
        ({"leg_max": legs.max() - 0.01}, 0.01),
        ({"leg_min": legs.min() + 0.01}, 0.01),
    ):
        found = ways(machine, rest, margins=replace(BARE, stroke=0.001))
        assert (found.reason, found.when, found.leg) == (Reason.NO_WAY_HOME, None, None)
        assert found.value == pytest.approx(beyond + 0.001, abs=1e-12)
        assert found.allowed == 0.0


def test_a_way_exactly_at_the_ends_of_the_stroke_is_a_way():
    rest = np.array([0.0, 0.0, 0.1, 0.0, 0.0, 0.0])
    legs = straight_ways(FREE, rest, np.zeros((1, 6)))[0].legs
    ends = {"leg_min": float(legs.min()), "leg_max": float(legs.max())}
    assert ways(ends, rest) is None
    assert ways(ends | {"leg_max": np.nextafter(ends["leg_max"], 0.0)}, rest) is not None
    assert ways(ends | {"leg_min": np.nextafter(ends["leg_min"], 9.0)}, rest) is not None


def test_a_way_of_exactly_a_minute_is_short_enough():
    rest = np.array([0.0, 0.0, 0.1, 0.0, 0.0, 0.0])
    pace = replace(FREE.pace, acceleration=1e12, jerk=1e12)
    speed = straight_way(replace(FREE, pace=replace(pace, speed=1.0)), rest, ZERO).duration
    speed = speed if speed > 0.5 else 1.875 * np.abs(np.diff(straight_way(
        FREE, rest, ZERO).legs, axis=0)).max() * 64  # fmt: skip
    exact = speed / 60.0
    for _ in range(10):
        if (
            straight_way(replace(FREE, pace=replace(pace, speed=exact)), rest, ZERO).duration
            == 60.0
        ):
            break
        exact = np.nextafter(exact, 1.0)
    assert ways({"pace": replace(pace, speed=exact)}, rest) is None
    slower = replace(pace, speed=exact * (1.0 - 1e-12))
    found = ways({"pace": slower}, rest)
    assert (found.when, found.leg, found.allowed) == (None, None, 60.0)


def test_the_posture_on_the_way_is_judged_at_every_fourth_pose_from_both_ends():
    for rest, home in ((ZERO, SKEW), (SKEW, ZERO), (-SKEW, SKEW)):
        poses = straight_way(compact(), rest, home).poses
        swing = swings(poses[::4])
        _, _, leg = np.unravel_index(swing.argmax(), swing.shape)
        found = ways({"joint_angle": swing.max() - 1e-9}, rest, (home,))
        assert found == Rejection(
            Reason.NO_WAY_HOME, None, int(leg), found.value, swing.max() - 1e-9
        )
        assert found.value == pytest.approx(swing.max(), abs=1e-12)
        assert ways({"joint_angle": swing.max() + 1e-9}, rest, (home,)) is None


def test_conditioning_that_is_worst_in_the_middle_of_the_way_is_told():
    rest = np.array([-0.055, 0.055, -0.236, 0.314, 0.303, -0.304])
    home = np.array([-0.159, 0.192, 0.010, -0.206, 0.219, 0.019])
    found = conditioning(compact(), straight_way(compact(), rest, home).poses[::4])
    worst = float(found.min())
    assert 0 < found.argmin() < len(found) - 1
    ratio = worst / neutral_conditioning(compact())
    assert ways({"conditioning": ratio * (1.0 - 1e-9)}, rest, (home,)) is None
    told = ways({"conditioning": ratio * (1.0 + 1e-9)}, rest, (home,))
    assert (told.reason, told.leg) == (Reason.NO_WAY_HOME, None)
    assert told.value == pytest.approx(worst, rel=1e-12)
    assert told.allowed == pytest.approx(worst * (1.0 + 1e-9), rel=1e-12)
