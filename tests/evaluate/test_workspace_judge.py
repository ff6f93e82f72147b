"""The judge of executed samples finds what it must, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest
from own_hexapod import NO_VIOLATIONS, own_legs, own_violations

from motionserver.core.kinematics.hexapod import leg_lengths
from motionserver.evaluate.metrics.workspace import workspace_figures
from motionserver.settings.machine import load_machine

RATE = 500.0
MACHINE = load_machine("t2-compact")


def sway(amplitude, hertz, axis=2, seconds=4.0):
    times = np.arange(0.0, seconds, 1.0 / RATE)
    pose = np.zeros((len(times), 6))
    pose[:, axis] = amplitude * np.sin(2.0 * np.pi * hertz * times)
    return pose


def judged(pose, machine=MACHINE):
    return workspace_figures(machine, pose, leg_lengths(machine, pose), 1.0 / RATE)


def violated(figures):
    return {margin.name for margin in figures.margins if margin.violations}


def test_small_motion_breaks_nothing():
    pose = sway(0.05, 0.5)
    figures = judged(pose)
    assert figures.violations == 0
    assert own_violations(pose, RATE) == NO_VIOLATIONS
    assert all(margin.margin > 0.0 for margin in figures.margins)
    assert figures.excursion[2] == pytest.approx(0.05, rel=1e-4)
    assert 0.0 < figures.stroke_used_mean <= figures.stroke_used < 1.0


@pytest.mark.parametrize(
    ("amplitude", "hertz", "broken"),
    [
        (0.21, 0.1, {"longest leg"}),
        (0.1, 1.5, {"leg speed"}),
        (0.02, 4.0, {"leg acceleration"}),
        (0.003, 20.0, {"leg jerk", "leg acceleration"}),
    ],
)
def test_each_limit_is_seen(amplitude, hertz, broken):
    pose = sway(amplitude, hertz)
    figures = judged(pose)
    assert broken <= violated(figures)
    assert figures.violations > 0
    worst = {margin.name: margin for margin in figures.margins}
    for name in broken:
        assert worst[name].margin < 0.0


def test_own_kinematics_of_the_tests_agree_with_the_servers():
    pose = np.random.default_rng(3).uniform(-0.15, 0.15, (200, 6))
    assert own_legs(pose) == pytest.approx(leg_lengths(MACHINE, pose), abs=1e-12)


def test_short_leg_tilt_and_ill_conditioned_pose_are_seen():
    assert "shortest leg" in violated(judged(sway(0.35, 0.1, seconds=10.0)))
    assert "joint angle" in violated(judged(sway(1.2, 0.05, axis=4, seconds=10.0)))
    assert "sigma_min / neutral" in violated(judged(sway(1.2, 0.05, axis=4, seconds=10.0)))


def test_absent_limits_are_not_checked():
    free = replace(MACHINE, leg_jerk=None, joint_angle=None, conditioning=None)
    figures = judged(sway(0.003, 20.0), free)
    unchecked = {margin.name for margin in figures.margins if margin.limit is None}
    assert unchecked == {"leg jerk", "joint angle", "sigma_min / neutral"}
    assert "leg jerk" not in violated(figures)


def test_passenger_limit_is_checked_where_named():
    figures = judged(sway(0.05, 1.0), replace(MACHINE, passenger_acceleration=1.0))
    assert "passenger acceleration" in violated(figures)
