from math import atan2, degrees, tau

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motion_clients.hexapod_legs import (
    T2_COMPACT,
    PoseNotFoundError,
    rotation,
    to_platform_axes,
)

# Single-axis reach published with the joint table [m, deg]; pitch is smaller nose down.
REACH = {
    "surge": (0, 1, 0.1979),
    "sway": (1, 1, 0.2201),
    "heave": (2, 1, 0.1998),
    "roll": (3, 1, 17.489),
    "nose down": (4, 1, 16.322),
    "nose up": (4, -1, 24.85),
    "yaw": (5, 1, 17.486),
}
ORIGIN = (0.0,) * 6


def poses(position=0.05, angle=0.08):
    return st.tuples(*[st.floats(-position, position)] * 3, *[st.floats(-angle, angle)] * 3)


def is_reachable(pose):
    return all(0.0 <= x <= T2_COMPACT.stroke for x in T2_COMPACT.extensions(pose))


@pytest.mark.parametrize("name", REACH)
def test_reach_along_one_axis_is_the_published_one(name):
    axis, sign, limit = REACH[name]
    low, high = 0.0, 1.0
    for _ in range(40):
        middle = (low + high) / 2
        pose = [0.0] * 6
        pose[axis] = sign * middle
        low, high = (middle, high) if is_reachable(pose) else (low, middle)
    found = degrees(low) if axis > 2 else low
    assert found == pytest.approx(limit, rel=5e-4)


def test_legs_count_counter_clockwise_from_front_left():
    assert T2_COMPACT.base[0] == (1.2729, 0.5241, 0.0)
    bearings = [atan2(y, x) % tau for x, y, _ in T2_COMPACT.base]
    assert bearings == sorted(bearings)
    # Roll lifts the left side; the right legs do the same as the left ones rolled back.
    left, right = (
        T2_COMPACT.extensions((0, 0, 0, 0.05, 0, 0)),
        T2_COMPACT.extensions((0, 0, 0, -0.05, 0, 0)),
    )
    assert left == pytest.approx(right[::-1])
    assert left[1] > left[4]


def test_neutral_legs_are_equal():
    legs = T2_COMPACT.extensions(ORIGIN)
    assert legs == pytest.approx([legs[0]] * 6, abs=1e-4)
    assert legs[0] + T2_COMPACT.leg_retracted == pytest.approx(1.0318, abs=1e-4)


@given(pose=poses())
@settings(max_examples=50)
def test_pose_of_its_own_legs_is_itself(pose):
    assert T2_COMPACT.pose(T2_COMPACT.extensions(pose), ORIGIN) == pytest.approx(pose, abs=1e-8)


@given(pose=poses(), change=poses(1.0, 1.0))
@settings(max_examples=50)
def test_twist_is_the_derivative_of_the_pose(pose, change):
    h = 1e-6
    there = [x + h * v for x, v in zip(pose, change, strict=True)]
    back = [x - h * v for x, v in zip(pose, change, strict=True)]
    longer, shorter = T2_COMPACT.extensions(there), T2_COMPACT.extensions(back)
    rates = [(b - a) / (2 * h) for a, b in zip(shorter, longer, strict=True)]
    velocity, spin = T2_COMPACT.twist(pose, rates)
    assert velocity == pytest.approx(change[:3], abs=1e-6)
    # The angular velocity is what turns the platform's axes: R' R^T is its skew matrix.
    r, r0, r1 = rotation(pose), rotation(back), rotation(there)
    turn = [[(r1[i][k] - r0[i][k]) / (2 * h) for k in range(3)] for i in range(3)]
    skew = [[sum(turn[i][k] * r[j][k] for k in range(3)) for j in range(3)] for i in range(3)]
    assert spin == pytest.approx((skew[2][1], skew[0][2], skew[1][0]), abs=1e-5)


def test_nose_down_puts_gravity_reaction_backwards_in_platform_axes():
    x, y, z = to_platform_axes((0, 0, 0, 0, 0.1, 0), (0.0, 0.0, 9.81))
    assert x < 0
    assert y == 0
    assert 0 < z < 9.81


def test_contradicting_legs_have_no_pose():
    with pytest.raises(PoseNotFoundError):
        T2_COMPACT.pose((5.0, -0.9, 5.0, -0.9, 5.0, -0.9), ORIGIN)
