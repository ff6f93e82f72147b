"""A vehicle that stands feels 9.81 m/s2, upwards in its own attitude: nothing else is believed."""

import math

import numpy as np
import pytest
from motion_clients.recording import read_recording, recording_path
from motion_protocol import Cue, Flags, Motion, encode_cue
from motions import motion, preview

from motionserver.core.intake.gate import Gate
from motionserver.core.intake.plausibility import Plausibility
from motionserver.core.kinematics.rotation import gravity_in_body
from motionserver.core.state import DriveMode
from motionserver.sources.native import NativeSource

OWNER = ("native", "10.0.0.1:5")
MS = 1_000_000
NONE = Flags(0)


def native(values, flags=NONE, seconds=2.0, speed=0.0, attitude=None, rate_hz=100):
    """What is said of a vehicle that stands, sent as bytes."""
    gate, source = Gate(), NativeSource()
    for k in range(round(seconds * rate_hz)):
        told = Motion(values, (0.0, 0.0, 0.0), attitude, None, speed)
        now = k * 1000 * MS // rate_hz
        data = encode_cue(Cue(1, k, now, now, told, flags=flags))
        assert gate.refuse(*OWNER, source.decode(data, now)) is None
    return gate.plausibility.complaint()


@pytest.mark.parametrize("speed", [0.0, None])
@pytest.mark.parametrize(
    ("values", "flags", "said"),
    [
        ((0.0, 0.0, 9.81), NONE, "gravity is counted twice. The values contain it: set the flag"),
        ((0.0, 0.0, 0.0), Flags.GRAVITY_INCLUDED, "gravity is missing. Clear the flag"),
        ((0.0, 0.0, -9.81), NONE, "z must point up"),
    ],
)
def test_gravity_that_is_wrong_is_named_with_the_flag(values, flags, said, speed):
    assert said in native(values, flags, speed=speed)


@pytest.mark.parametrize(
    ("values", "flags", "said"),
    [
        ((0.0, 0.0, 1.0), Flags.GRAVITY_INCLUDED, "is it sent in g?"),
        ((0.0, 0.0, 32.2), Flags.GRAVITY_INCLUDED, "check the unit"),
        ((0.0, 0.0, -9.81), Flags.GRAVITY_INCLUDED, "check axes and signs"),
        ((0.0, 0.0, 10.32), Flags.GRAVITY_INCLUDED, "is 10.32 m/s2, it must be 9.81 within 0.5"),
        ((0.0, 0.0, 9.30), Flags.GRAVITY_INCLUDED, "is 9.30 m/s2"),
    ],
)
def test_a_wrong_force_at_standstill_is_named(values, flags, said):
    assert said in native(values, flags)


@pytest.mark.parametrize(
    ("values", "flags", "said"),
    [
        ((0.0, 0.0, 9.81), NONE, "counted twice"),
        ((0.0, 0.0, 0.0), Flags.GRAVITY_INCLUDED, "missing"),
        ((5.0, 0.0, 9.81), Flags.GRAVITY_INCLUDED, ""),
        ((0.0, 0.0, 14.0), Flags.GRAVITY_INCLUDED, ""),
    ],
)
def test_of_a_steady_drive_only_gravity_is_judged(values, flags, said):
    found = native(values, flags, speed=20.0, seconds=4.0)
    assert bool(found) is bool(said)
    assert said in found
    assert native(values, flags, speed=20.0, seconds=2.9) == ""


@pytest.mark.parametrize("size", [9.32, 9.81, 10.30])
def test_a_force_within_half_a_metre_is_right(size):
    assert native((0.0, 0.0, size), Flags.GRAVITY_INCLUDED) == ""


def test_a_slope_is_felt_as_its_attitude_says():
    roll, pitch = 0.1, -0.2
    felt = tuple(gravity_in_body(np.array(roll), np.array(pitch)).tolist())
    assert native(felt, Flags.GRAVITY_INCLUDED, attitude=(roll, pitch)) == ""
    assert native((0.0, 0.0, 0.0), attitude=(roll, pitch)) == ""
    wrong = native(felt, Flags.GRAVITY_INCLUDED, attitude=(roll, -pitch))
    assert "pitch positive nose down" in wrong
    assert "must be (-1.95" in wrong


def test_a_second_of_standing_is_needed():
    assert native((0.0, 0.0, 9.81), seconds=0.9) == ""
    assert native((0.0, 0.0, 9.81), seconds=1.1) != ""


@pytest.mark.parametrize("rate_hz", [10, 60, 1000])
def test_it_is_found_at_every_rate(rate_hz):
    assert "twice" in native((0.0, 0.0, 9.81), rate_hz=rate_hz)


@pytest.mark.parametrize(
    "moving",
    [
        {"speed": 0.2},
        {"rates": (0.0, 0.0, 0.06)},
        {"mode": DriveMode.PAUSE},
        {"mode": DriveMode.TELEPORT},
    ],
)
def test_what_does_not_stand_is_not_judged(moving):
    checks = Plausibility()
    for k in range(300):
        told = {"speed": 0.0, "speed_known": True, **moving}
        checks.heard(motion(10.0 * k, k, force=(0.0, 0.0, 12.0), **told))
    assert checks.complaint() == ""


def test_a_force_that_changes_is_no_standstill_whatever_the_speed_says():
    checks = Plausibility()
    for k in range(400):
        x = 6.0 + 3.0 * math.sin(0.05 * k)
        checks.heard(motion(10.0 * k, k, x=x, speed=0.0, speed_known=True))
    assert checks.complaint() == ""


def test_a_complaint_stays_until_a_standstill_was_right():
    checks = Plausibility()

    def hear(begin, force, speed):
        for k in range(begin, begin + 150):
            checks.heard(motion(10.0 * k, k, force=force, speed=speed, speed_known=True))
        return bool(checks.complaint())

    assert hear(0, (0.0, 0.0, 19.62), 0.0)
    assert hear(150, (0.0, 0.0, 19.62), 20.0)
    assert hear(300, (0.0, 0.0, 9.81), 20.0)
    assert not hear(450, (0.0, 0.0, 9.81), 0.0)


RECORDINGS = [
    "truck_brake_accel",
    "truck_lanechange_slalom",
    "truck_roundabout",
    "truck_puncture",
    "truck_rough_road",
    "torcs_car_drive",
    "flight_c172_takeoff_turbulence",
]


def driven(name, change=lambda told: told):
    """Complaints of a recorded drive, at 50 Hz."""
    recording = read_recording(recording_path(name))
    checks, found = Plausibility(), set()
    for k, one in enumerate(recording.samples[::2]):
        roll, pitch = one.attitude
        gravity = gravity_in_body(np.array(roll), np.array(pitch))
        told = {
            "force": np.array(one.acceleration) + gravity,
            "rates": np.array(one.rates),
            "speed": one.speed,
            "attitude": one.attitude,
        }
        checks.heard(motion(1000.0 * one.time, k, speed_known=True, **change(told)))
        found.add(checks.complaint())
    return found


@pytest.mark.parametrize("name", RECORDINGS)
def test_drives_as_they_are_give_no_cause(name):
    assert driven(name) == {""}


DEGREES = 180.0 / math.pi


def previewed(apart):
    checks = Plausibility()
    for k in range(200):
        checks.heard(motion(10.0 * k, k, x=1.0, preview=preview([0.05, 0.1], x=1.0 + apart)))
    return checks.complaint()


def test_a_preview_that_is_about_something_else_is_named():
    assert previewed(0.0) == previewed(3.9) == ""
    assert "4.1 m/s2 from the cue" in previewed(4.1)


def change(name, apply):
    def changed(told):
        told[name] = apply(told[name])
        return told

    return changed


@pytest.mark.parametrize(
    ("name", "applied", "said"),
    [
        ("truck_lanechange_slalom", change("speed", lambda v: 3.6 * v), "lateral"),
        ("truck_roundabout", change("rates", lambda w: w * DEGREES), "rad"),
        ("truck_roundabout", change("rates", lambda w: w / (2.0 * math.pi)), "yaw rate"),
        ("truck_roundabout", change("rates", lambda w: -w), "sign is wrong"),
        ("flight_c172_takeoff_turbulence", change("attitude", lambda a: (-a[0], a[1])), "roll"),
        ("flight_c172_takeoff_turbulence", change("attitude", lambda a: (a[0], -a[1])), "pitch"),
        ("truck_brake_accel", change("force", lambda f: f * (-1, 1, 1)), "forward acceleration"),
        (
            "truck_lanechange_slalom",
            change("force", lambda f: f * (1, -1, 1)),
            "lateral acceleration",
        ),
    ],
)
def test_a_unit_or_a_sign_that_is_wrong_is_named(name, applied, said):
    assert any(said in text for text in driven(name, applied)), driven(name, applied)
