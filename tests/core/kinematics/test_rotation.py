import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from machines import compact
from scipy.spatial.transform import Rotation

from motionserver.core.kinematics.rotation import (
    euler_rate_matrix,
    euler_rate_matrix_dot,
    felt,
    gravity_in_body,
    rotation,
    transfer,
)

G = 9.81
angles = st.tuples(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1)).map(np.array)
rates = st.tuples(*[st.floats(-2.0, 2.0)] * 3).map(np.array)


@given(angles)
def test_rotation_is_yaw_pitch_roll(rpy):
    expected = Rotation.from_euler("ZYX", rpy[::-1].copy()).as_matrix()
    assert rotation(rpy) == pytest.approx(expected, abs=1e-14)
    assert rotation(np.stack((rpy, rpy)))[1] == pytest.approx(expected, abs=1e-14)


@given(angles, rates)
def test_euler_rates_give_the_angular_velocity(rpy, rate):
    h = 1e-5
    ahead, behind = rotation(rpy + rate * h), rotation(rpy - rate * h)
    skew = (ahead - behind) / (2 * h) @ rotation(rpy).T
    omega = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
    assert euler_rate_matrix(rpy) @ rate == pytest.approx(omega, abs=1e-8)
    slope = (euler_rate_matrix(rpy + rate * h) - euler_rate_matrix(rpy - rate * h)) / (2 * h)
    assert euler_rate_matrix_dot(rpy, rate) == pytest.approx(slope, abs=1e-8)


@pytest.mark.parametrize(
    ("roll", "pitch", "expected"),
    [
        (10.0, 0.0, [0.0, 1.7035, 9.6610]),
        (0.0, 10.0, [-1.7035, 0.0, 9.6610]),
        (-10.0, 0.0, [0.0, -1.7035, 9.6610]),
        (0.0, -10.0, [1.7035, 0.0, 9.6610]),
        (0.0, 0.0, [0.0, 0.0, 9.81]),
    ],
)
def test_nose_down_pulls_forward_left_up_pulls_left(roll, pitch, expected):
    found = gravity_in_body(np.radians(roll), np.radians(pitch))
    assert found == pytest.approx(expected, abs=5e-5)
    pose = np.array([0.0, 0.0, 0.0, np.radians(roll), np.radians(pitch), 0.7])
    force, spin = felt(pose, np.zeros(6), np.zeros(6), np.array([0.3, -0.2, 1.2]))
    assert force == pytest.approx(expected, abs=5e-5)
    assert spin == pytest.approx(np.zeros(3))


@given(angles)
def test_at_rest_gravity_keeps_its_size(rpy):
    found = gravity_in_body(rpy[0], rpy[1])
    assert np.linalg.norm(found) == pytest.approx(G)
    assert found == pytest.approx(rotation(rpy).T @ [0.0, 0.0, G], abs=1e-12)


@pytest.mark.parametrize(
    ("spin_dot", "arm", "expected"),
    [
        ([0, 1, 0], [0, 0, 1], [1, 0, 0]),
        ([1, 0, 0], [0, 0, 1], [0, -1, 0]),
        ([0, 0, 1], [1, 0, 0], [0, 1, 0]),
        ([0, 0, 1], [0, 1, 0], [-1, 0, 0]),
        ([0, 1, 0], [1, 0, 0], [0, 0, -1]),
        ([1, 0, 0], [0, 1, 0], [0, 0, 1]),
    ],
)
def test_transfer_of_angular_acceleration(spin_dot, arm, expected):
    found = transfer(np.zeros(3), np.zeros(3), np.array(spin_dot, float), np.array(arm, float))
    assert found == pytest.approx(expected)


def test_transfer_points_to_the_axis_when_turning():
    found = transfer(np.zeros(3), np.array([0.0, 0.0, 2.0]), np.zeros(3), np.array([0.5, 0, 0.0]))
    assert found == pytest.approx([-2.0, 0.0, 0.0])


@given(st.lists(st.floats(-1, 1), min_size=18, max_size=18).map(np.array))
def test_felt_is_what_an_accelerometer_at_the_head_reads(numbers):
    pose = numbers[:6] * compact().box
    velocity, acceleration = numbers[6:12], numbers[12:] * 4
    arm = np.array([0.2, -0.1, 1.2])
    h = 1e-4
    times = np.array([-1.0, 0.0, 1.0])[:, None] * h
    poses = pose + velocity * times + acceleration * times**2 / 2
    turn = Rotation.from_euler("ZYX", poses[:, [5, 4, 3]])
    head = poses[:, :3] + turn.apply(arm)
    second = (head[2] - 2 * head[1] + head[0]) / h**2
    force, spin = felt(pose, velocity, acceleration, arm)
    assert force == pytest.approx(turn[1].apply(second + G * np.eye(3)[2], inverse=True), abs=1e-5)
    turned = (turn[0].inv() * turn[2]).as_rotvec() / (2 * h)
    assert spin == pytest.approx(turned, abs=1e-6)


def test_linear_signs():
    still = np.zeros(6)
    for axis, index, expected in ((0, 0, 1.0), (1, 1, 1.0), (2, 2, 1.0)):
        force, _ = felt(still, still, np.eye(6)[axis], np.zeros(3))
        assert force[index] == pytest.approx(expected + (G if axis == 2 else 0.0))
