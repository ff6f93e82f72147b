"""The drive in lock-step: the live code, deterministic, and never beyond a limit."""

from dataclasses import fields, replace

import numpy as np
import pytest
from own_hexapod import NO_VIOLATIONS, RECORDINGS, own_violations

from motionserver.core.axes import GRAVITY
from motionserver.cueing.think import Thinker
from motionserver.cueing.tuning import Tuning
from motionserver.evaluate.drive import Drive, Periods, no_motion, wanted_at
from motionserver.evaluate.lockstep import drive
from motionserver.evaluate.metrics.figures import figures_of, rmse_xy
from motionserver.evaluate.recording import from_samples, read_recording
from motionserver.settings.machine import load_machine

MACHINE = load_machine("t2-compact")
BRAKE = read_recording(RECORDINGS / "truck_brake_accel.csv").excerpt(40.0, 44.0)


def made(seconds, rate=100.0, forward=0.0):
    times = np.arange(round(seconds * rate) + 1) / rate
    force = np.tile([forward, 0.0, GRAVITY], (len(times), 1))
    return from_samples("made", times, force, np.zeros((len(times), 3)), np.zeros(len(times)))


@pytest.mark.parametrize("algorithm", ["classical", "thondel2014"])
def test_two_runs_are_equal_to_the_bit_and_break_no_limit(algorithm):
    tuning = Tuning(algorithm=algorithm, scale=1.0)
    first, second = (drive(MACHINE, BRAKE, tuning) for _ in range(2))
    for field in fields(Drive):
        one, other = getattr(first, field.name), getattr(second, field.name)
        if isinstance(one, np.ndarray):
            assert one.tobytes() == other.tobytes(), field.name
    for field in fields(Periods):
        one, other = getattr(first.periods, field.name), getattr(second.periods, field.name)
        if isinstance(one, np.ndarray) and field.name != "seconds":
            assert one.tobytes() == other.tobytes(), field.name
        elif isinstance(one, dict):
            assert one == other
    assert own_violations(first.pose, first.rate) == NO_VIOLATIONS
    assert first.periods.rejections == {}
    assert np.max(np.abs(first.pose)) > 0.01


def test_it_begins_at_neutral_and_ends_with_the_last_sample():
    driven = drive(MACHINE, BRAKE, Tuning(algorithm="classical"))
    assert driven.times[0] == 0.0
    assert driven.times[-1] == pytest.approx(BRAKE.duration)
    assert not driven.pose[0].any()
    assert len(driven.times) == 2001
    assert len(driven.periods.times) == 401


def test_a_cue_takes_over_one_period_after_it_was_heard():
    driven = drive(MACHINE, made(0.2, forward=2.0), Tuning(algorithm="classical"))
    moving = np.abs(driven.pose).max(axis=1) > 0.0
    # heard at 0, played from 10 ms on; the sample at 10 ms is where it begins
    assert not moving[driven.times < 0.0101].any()
    assert moving[driven.times > 0.0121].all()


@pytest.mark.parametrize("rate", [60.0, 240.0, 333.0])
def test_samples_at_any_rate_lie_on_the_same_motion(rate):
    tuning = Tuning(algorithm="classical")
    fine = drive(MACHINE, made(1.0, forward=1.0), tuning, rate=1000.0)
    coarse = drive(MACHINE, made(1.0, forward=1.0), tuning, rate=rate)
    for axis in (0, 4):
        there = np.interp(coarse.times, fine.times, fine.pose[:, axis])
        assert coarse.pose[:, axis] == pytest.approx(there, abs=2e-6)


def test_velocity_and_acceleration_are_derivatives_of_the_pose():
    driven = drive(MACHINE, BRAKE, Tuning(algorithm="classical"))
    middle = slice(5, -5)
    slope = np.gradient(driven.pose, driven.times, axis=0)
    bend = np.gradient(driven.velocity, driven.times, axis=0)
    assert slope[middle] == pytest.approx(driven.velocity[middle], abs=2e-3)
    assert bend[middle] == pytest.approx(driven.acceleration[middle], abs=0.1)


def test_scale_and_head_make_the_reference():
    times = np.array([0.0, 1.0, 2.0])
    rates = np.column_stack((np.zeros(3), times, np.zeros(3)))
    force = np.tile([1.0, 0.0, GRAVITY], (3, 1))
    recording = from_samples("turning", times, force, rates, np.zeros(3))
    wanted, turning = wanted_at(recording, np.array([1.0]), 0.5, np.array([0.0, 0.0, 1.0]))
    # pitch acceleration 1 rad/s2 and 1 m above: +1 m/s2 forward, and 1 m/s2 towards the centre
    assert wanted[0] == pytest.approx([1.0, 0.0, -0.5])
    assert turning[0] == pytest.approx([0.0, 0.5, 0.0])


def test_silence_in_the_recording_fades_the_cue():
    whole = made(3.0, forward=2.0)
    kept = (whole.times < 1.0) | (whole.times > 2.5)
    gap = from_samples(
        "gap", whole.times[kept], whole.force[kept], whole.rates[kept], whole.speed[kept]
    )
    periods = drive(MACHINE, gap, Tuning(algorithm="classical", scale=1.0)).periods
    during = (periods.times > 1.5) & (periods.times < 2.4)
    assert np.abs(periods.force[during, 0]).max() == 0.0
    assert periods.force[periods.times < 0.9, 0] == pytest.approx(2.0)


def test_implausible_samples_are_counted_not_followed():
    recording = made(0.3, forward=1.0)
    force = recording.force.copy()
    force[10] = [500.0, 0.0, GRAVITY]
    spoilt = replace(recording, force=force)
    periods = drive(MACHINE, spoilt, Tuning(algorithm="classical")).periods
    assert periods.gate == {"out-of-range": 1}
    assert np.abs(periods.force).max() == pytest.approx(0.6)


def test_algorithm_that_raises_is_counted_and_the_platform_rests():
    class Broken:
        name = "broken"
        disturbance = np.zeros(3)

        def propose(self, start, parent, takeover, stimulus):
            raise FloatingPointError("no such root")

        def report(self):
            raise AssertionError

    thinker = Thinker(MACHINE, Tuning(), 0.01, MACHINE.parked_pose[None])
    thinker.cueing = Broken()
    driven = drive(MACHINE, made(0.005, forward=1.0), Tuning(), thinker=thinker)
    assert driven.periods.troubles == {"FloatingPointError: no such root": 1}
    assert np.isnan(driven.periods.kappa).all()
    assert not driven.pose.any()


def test_preview_is_told_ahead_and_ends_with_the_recording():
    heard = []

    class Listener(Thinker):
        def think(self, parent, before, takeover, stimulus, plan_id):
            heard.append(stimulus.preview)
            return super().think(parent, before, takeover, stimulus, plan_id)

    times = np.arange(101) / 100.0
    force = np.column_stack((times, np.zeros(101), np.full(101, GRAVITY)))
    ramp = from_samples("ramp", times, force, np.zeros((101, 3)), np.zeros(101))
    thinker = Listener(MACHINE, Tuning(algorithm="classical"), 0.01, MACHINE.parked_pose[None])
    drive(MACHINE, ramp, Tuning(scale=0.5), preview=0.5, thinker=thinker)
    # what a packet carries: 20 samples every 10 ms, 20 more up to half a second
    told = np.concatenate((np.arange(1, 21) * 0.01, 0.2 + np.arange(1, 21) * 0.015))
    assert heard[20].times == pytest.approx(told)
    assert heard[20].force[:, 0] == pytest.approx(0.5 * (0.2 + told))
    assert len(heard[80].times) == 20
    assert heard[100] is None


def test_no_motion_has_the_whole_error():
    still = no_motion(MACHINE, BRAKE, 0.6)
    figures = figures_of(still)
    assert figures.nrmse_xy == pytest.approx(1.0)
    assert figures.rmse_xy == rmse_xy(still)
    assert figures.workspace.violations == 0
    assert figures.planning is None


@pytest.mark.parametrize("rates", [{"rate": 0.0}, {"planner_hz": float("nan")}])
def test_senseless_rates_are_refused(rates):
    with pytest.raises(ValueError, match="must be positive"):
        drive(MACHINE, BRAKE, Tuning(), **rates)
