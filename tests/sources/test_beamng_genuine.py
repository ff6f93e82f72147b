"""A packet captured from the game decides the signs, by its physics.

A car in free fall, nose 40.5 degrees down, at 85.8 m/s: nothing but air drag acts on it, so its
specific force is small and points against the way it moves. The packet's own `up` vector and
world velocity prove the angles; from there on the game's axes follow for the encoder as well.
"""

import math
import struct

import numpy as np
import pytest
from motion_clients.beamng import MotionSimEncoder
from motion_clients.recording import RecordedSample, read_recording, recording_path

from motionserver.sources.beamng import BeamNgSource

FREE_FALL = bytes.fromhex(
    "424e4731974f5b43d50cb1c3f85a284448efa2bc4c7c93420b062fc24e56b83e"
    "f118a240f3ee01c13f0c573d818e253f58cc423f87ac083d279534bfb333f23c"
    "599c7e3c244784be73314d3c562617be8775c0bfd3fe2e3d"
)
GRAVITY = 9.81


def fields(packet: bytes) -> dict[str, np.ndarray]:
    names = ["position", "velocity", "acceleration", "up", "angles", "rates", "angular"]
    rows = np.array(struct.unpack_from("<21f", packet, 4)).reshape(7, 3)
    return dict(zip(names, rows, strict=True))


def axes_in_world(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Right, forward and up of a vehicle as columns, world of the game: X east, Y north, Z up.

    Yaw turns clockwise from north, pitch lifts the nose, roll lowers the right side.
    """
    level_right = np.array([math.cos(yaw), -math.sin(yaw), 0.0])
    level_forward = np.array([math.sin(yaw), math.cos(yaw), 0.0])
    sky = np.array([0.0, 0.0, 1.0])
    forward = math.cos(pitch) * level_forward + math.sin(pitch) * sky
    upright = math.cos(pitch) * sky - math.sin(pitch) * level_forward
    right = math.cos(roll) * level_right - math.sin(roll) * upright
    up = math.sin(roll) * level_right + math.cos(roll) * upright
    return np.column_stack([right, forward, up])


def test_the_captured_up_vector_proves_the_signs_of_the_angles() -> None:
    told = fields(FREE_FALL)
    axes = axes_in_world(*told["angles"])
    assert axes[:, 2] == pytest.approx(told["up"], abs=2e-4)
    # and it flies nearly where its nose points
    assert axes[:, 1] @ told["velocity"] > 0.98 * np.linalg.norm(told["velocity"])


def test_a_captured_free_fall_feels_its_air_drag_only() -> None:
    sample = BeamNgSource().decode(FREE_FALL, 0)
    assert sample.speed == pytest.approx(85.75, abs=0.1)
    assert float(np.linalg.norm(sample.force)) == pytest.approx(1.45, abs=0.02)
    assert sample.force[0] < -1.0, "the drag pushes back"
    assert sample.rates == pytest.approx([0.01554, 0.25836, -0.01252], abs=1e-4)


def test_the_decoded_force_is_the_captured_acceleration_in_the_world_and_gravity() -> None:
    told = fields(FREE_FALL)
    in_world = axes_in_world(*told["angles"]) @ told["acceleration"] + [0.0, 0.0, GRAVITY]
    # against the way it moves: that is what drag does
    assert in_world @ told["velocity"] < -0.9 * np.linalg.norm(in_world) * 85.7
    force = BeamNgSource().decode(FREE_FALL, 0).force
    right_forward_up = axes_in_world(*told["angles"]).T @ in_world
    assert [-force[1], force[0], force[2]] == pytest.approx(right_forward_up, abs=1e-3)


def test_our_encoder_writes_the_captured_fall_as_the_game_does() -> None:
    told = fields(FREE_FALL)
    right, forward, up = told["acceleration"]
    roll, pitch, _ = told["angles"]
    roll_rate, pitch_rate, yaw_rate = told["rates"]
    # ISO 8855: x forward, y left; pitch positive nose down; turning right is negative
    sample = RecordedSample(
        0.0,
        (forward, -right, up),
        (roll_rate, -pitch_rate, -yaw_rate),
        85.75,
        (roll, -pitch),
    )
    written = fields(MotionSimEncoder().encode(sample))
    assert written["acceleration"] == pytest.approx(told["acceleration"], abs=1e-5)
    assert written["rates"] == pytest.approx(told["rates"], abs=1e-5)
    assert written["angles"][:2] == pytest.approx(told["angles"][:2], abs=1e-6)
    level = axes_in_world(roll, pitch, 0.0)
    assert written["up"] == pytest.approx(level[:, 2], abs=1e-5)
    assert written["velocity"] == pytest.approx(85.75 * level[:, 1], abs=1e-3)


@pytest.mark.parametrize("name", ["truck_roundabout", "truck_brake_accel"])
def test_encoded_drives_move_in_the_world_as_their_accelerations_say(name: str) -> None:
    """What the packets' acceleration says is what becomes of the packets' world velocity."""
    encoder = MotionSimEncoder()
    packets = [fields(encoder.encode(one)) for one in read_recording(recording_path(name)).samples]
    velocity = np.array([one["velocity"] for one in packets])
    said = np.array(
        [axes_in_world(*one["angles"])[:, :2] @ one["acceleration"][:2] for one in packets]
    )
    window = np.ones(50) / 50.0
    for axis in (0, 1):
        became = np.convolve(np.gradient(velocity[:, axis], 0.01), window, "valid")
        meant = np.convolve(said[:, axis], window, "valid")
        if np.std(became) > 0.3:
            assert np.corrcoef(became, meant)[0, 1] > 0.9, axis
            assert np.polyfit(became, meant, 1)[0] == pytest.approx(1.0, abs=0.2), axis
