import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from machines import compact, science_fit
from own_kinematics import lengths
from scipy.spatial.transform import Rotation

from motionserver.core.axes import frozen
from motionserver.core.kinematics.forward import NoPoseError, forward
from motionserver.core.kinematics.hexapod import (
    conditioning,
    jacobian,
    joint_angles,
    leg_directions,
    leg_lengths,
    leg_speeds,
    neutral_conditioning,
)

ANCHOR = np.array([0.05, -0.03, 0.02, *np.radians([3.0, -4.0, 5.0])])
shares = st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6).map(np.array)


def reach(machine, direction):
    """How far one can go from neutral along ``direction`` (6,) until a leg ends, by bisection."""
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = (low + high) / 2
        legs = leg_lengths(machine, direction * middle)
        inside = machine.leg_min <= legs.min() and legs.max() <= machine.leg_max
        low, high = (middle, high) if inside else (low, middle)
    return low


def test_the_published_anchor_pose():
    expected = [0.727586, 0.816204, 0.801816, 0.779815, 0.651627, 0.839584]
    assert leg_lengths(science_fit(), ANCHOR) == pytest.approx(expected, abs=6e-7)


def test_the_fixture_stands_at_mid_stroke():
    assert leg_lengths(science_fit(), np.zeros(6)) == pytest.approx([0.75278] * 6, abs=6e-6)


@pytest.mark.parametrize(
    ("axis", "low", "high"),
    [
        (0, 0.249, 0.198),
        (1, 0.219, 0.219),
        (2, 0.258, 0.201),
        (3, 17.4, 17.4),
        (4, 17.6, 16.3),
        (5, 17.6, 17.6),
    ],
)
def test_single_axis_ranges_of_the_fixture(axis, low, high):
    unit = 1.0 if axis < 3 else np.pi / 180
    for sign, expected in ((-1.0, low), (1.0, high)):
        found = reach(science_fit(), sign * np.eye(6)[axis]) / unit
        assert found == pytest.approx(expected, abs=0.0015 if axis < 3 else 0.06)


@pytest.mark.parametrize(
    ("axis", "expected"),
    [(0, 0.1979), (1, 0.2201), (2, 0.1998), (3, 17.489), (4, 16.322), (5, 17.486)],
)
def test_single_axis_ranges_of_the_preset(axis, expected):
    unit = 1.0 if axis < 3 else np.pi / 180
    both = [reach(compact(), sign * np.eye(6)[axis]) / unit for sign in (-1.0, 1.0)]
    assert min(both) == pytest.approx(expected, abs=1e-4 if axis < 3 else 1e-3)


def test_pitch_reaches_further_nose_up_than_nose_down():
    up, down = (np.degrees(reach(compact(), sign * np.eye(6)[4])) for sign in (-1.0, 1.0))
    assert up == pytest.approx(24.85, abs=0.01)
    assert down == pytest.approx(16.32, abs=0.01)


@pytest.mark.parametrize(("share", "reachable"), [(0.2, 64), (0.3, 30), (0.4, 2), (0.5, 0)])
def test_corners_of_the_box_are_out_of_reach(share, reachable):
    machine = compact()
    corners = np.array(list(itertools.product((-1.0, 1.0), repeat=6))) * machine.box * share
    legs = leg_lengths(machine, corners)
    inside = ((legs >= machine.leg_min) & (legs <= machine.leg_max)).all(axis=1)
    assert inside.sum() == reachable


@pytest.mark.parametrize("machine", [compact(), science_fit()], ids=lambda m: m.name)
@given(shares)
def test_lengths_agree_with_another_rotation(machine, share):
    pose = share * machine.box * 1.5
    found = leg_lengths(machine, pose)
    assert found.shape == (6,)
    assert found == pytest.approx(lengths(machine, pose)[0], abs=1e-13)
    assert leg_lengths(machine, np.stack((pose, pose)))[1] == pytest.approx(found, abs=1e-15)


@pytest.mark.parametrize("machine", [compact(), science_fit()], ids=lambda m: m.name)
@given(shares, shares)
def test_speed_is_the_derivative(machine, share, rate):
    pose, velocity = share * machine.box, rate * 0.5
    h = 1e-4
    legs = lengths(machine, pose + velocity * np.array([[-h], [0.0], [h]]))
    found, speed = leg_speeds(machine, pose[None], velocity[None])
    assert found[0] == pytest.approx(legs[1], abs=1e-13)
    assert speed[0] == pytest.approx((legs[2] - legs[0]) / (2 * h), abs=1e-5)
    assert jacobian(machine, pose[None])[0] @ velocity == pytest.approx(speed[0], abs=1e-12)


@pytest.mark.parametrize("machine", [compact(), science_fit()], ids=lambda m: m.name)
@given(shares)
def test_forward_undoes_inverse(machine, share):
    pose = share * np.array([0.15, 0.15, 0.15, *np.radians([14.0, 14.0, 14.0])])
    legs = leg_lengths(machine, pose)
    found = forward(machine, legs)
    # another assembly of the same legs would be as true; from neutral it is this one
    assert leg_lengths(machine, found) == pytest.approx(legs, abs=2e-9)
    if conditioning(machine, pose[None])[0] > 0.4 * neutral_conditioning(machine):
        assert found == pytest.approx(pose, abs=1e-7)
    near = forward(machine, legs, pose + 1e-3)
    assert leg_lengths(machine, near) == pytest.approx(legs, abs=2e-9)


@pytest.mark.parametrize(
    "legs",
    [
        np.full(6, 0.05),
        np.array([0.9, 5.0, 0.9, 5.0, 0.9, 5.0]),
        np.full(6, np.nan),
        np.full(6, np.inf),
        np.full(6, 1e30),
    ],
)
def test_impossible_legs_have_no_pose(legs):
    with pytest.raises(NoPoseError, match="leg order") as caught:
        forward(compact(), legs)
    assert not caught.value.residual <= 1e-9


def test_a_singular_hexapod_has_no_pose():
    machine = compact()
    twin = replace(
        machine,
        base_joints=frozen(np.repeat(machine.base_joints[:1], 6, axis=0)),
        platform_joints=frozen(np.repeat(machine.platform_joints[:1], 6, axis=0)),
    )
    with pytest.raises(NoPoseError):
        forward(twin, np.full(6, 1.1))


def test_joints_swing_by_what_the_platform_turns():
    machine = compact()
    pose = np.array([0.05, -0.02, 0.03, 0.1, -0.05, 0.2])
    swing = joint_angles(machine, np.stack((np.zeros(6), pose)))
    assert swing.shape == (2, 2, 6)
    assert swing[0].max() < 1e-7
    legs = leg_directions(machine, pose[None]).unit
    level = leg_directions(machine, np.zeros((1, 6))).unit
    turn = Rotation.from_euler("ZYX", pose[[5, 4, 3]])
    for leg in range(6):
        unit, axis = legs[0, leg], level[0, leg]
        assert swing[1, 0, leg] == pytest.approx(np.arccos(unit @ axis), abs=1e-9)
        assert swing[1, 1, leg] == pytest.approx(np.arccos(unit @ turn.apply(axis)), abs=1e-9)


def test_conditioning_of_the_fixture():
    # the published 0.900 and 0.654 scale angles by 0.75 m, ours by the joints' radius, 0.753 m
    assert neutral_conditioning(science_fit()) == pytest.approx(0.900 * 0.75 / 0.753, abs=0.002)
    rng = np.random.default_rng(0)
    spread = np.array([0.15, 0.15, 0.15, *np.radians([14.0, 14.0, 14.0])])
    values = conditioning(science_fit(), rng.uniform(-spread, spread, (4000, 6)))
    assert 0.60 < values.min() < 0.70
    assert values.max() < 0.905
