"""The washout chosen in hindsight: the screen agrees with the server, the better counts."""

import numpy as np
import pytest
from own_hexapod import RECORDINGS, own_legs

from motionserver.core.axes import GRAVITY
from motionserver.cueing.tuning import Tuning
from motionserver.evaluate.drive import no_motion
from motionserver.evaluate.hindsight import DRIVEN, GAINS, HIGHS, LOWS, find_hindsight
from motionserver.evaluate.metrics.figures import rmse_xy
from motionserver.evaluate.recording import from_samples, read_recording
from motionserver.evaluate.screen import STEP, Screen, Washout
from motionserver.evaluate.yardstick import find_yardstick
from motionserver.settings.machine import load_machine

MACHINE = load_machine("t2-compact")
CURVE = read_recording(RECORDINGS / "truck_roundabout.csv").excerpt(20.0, 24.0)
TUNING = Tuning(scale=0.6)


def steady(forward, seconds=8.0):
    times = np.arange(round(seconds * 100.0) + 1) / 100.0
    force = np.tile([forward, 0.0, GRAVITY], (len(times), 1))
    return from_samples("steady", times, force, np.zeros((len(times), 3)), np.zeros(len(times)))


@pytest.fixture(scope="module")
def found():
    return find_hindsight(MACHINE, CURVE, TUNING, rate=250.0)


def test_all_sets_are_screened_and_the_better_way_counts(found):
    assert len(found.screened) == len(HIGHS) * len(LOWS) * len(GAINS) == 63
    assert len(found.driven) == DRIVEN + 1
    assert [t.washout for t in found.driven[:DRIVEN]] == [
        t.washout for t in found.screened[:DRIVEN]
    ]
    inside = [trial.rmse for trial in found.screened if trial.inside]
    assert inside == sorted(inside)
    counts = rmse_xy(found.drive)
    assert counts <= min(trial.rmse for trial in found.driven)
    assert counts == found.best_server if found.by_server else counts == found.best_screen
    assert counts < rmse_xy(no_motion(MACHINE, CURVE, 0.6, 250.0))
    assert "counts" in found.described()


def bumpy(seed, up, seconds=6.0):
    """Smooth noise on all axes, heave and turns beyond what the screen finds inside."""
    rng = np.random.default_rng(seed)
    times = np.arange(round(seconds * 100.0) + 1) / 100.0
    grid = np.arange(0.0, seconds + 0.4, 0.25)
    draw = rng.normal(size=(6, len(grid)))
    sizes = np.array([1.5, 1.5, up, 0.2, 0.2, 0.2])
    columns = [np.interp(times, grid, s * d) for s, d in zip(sizes, draw, strict=True)]
    force = np.column_stack(columns)
    table = force[:, :3] + np.array([0.0, 0.0, GRAVITY])
    return from_samples("bumpy", times, table, force[:, 3:], np.full(len(times), 15.0))


def test_hindsight_is_never_worse_than_the_yardstick():
    recording = bumpy(2, 15.0)
    yardstick = find_yardstick(MACHINE, recording, TUNING, rate=250.0, planner_hz=50.0)
    given = find_hindsight(
        MACHINE, recording, TUNING, rate=250.0, planner_hz=50.0, yardstick=yardstick
    )
    assert rmse_xy(given.drive) <= rmse_xy(yardstick.drive)
    assert given.drive.name == "hindsight"


def test_without_a_yardstick_it_is_searched(found):
    yardstick = find_yardstick(MACHINE, CURVE, TUNING, rate=250.0)
    assert found.driven[-1].rmse == rmse_xy(yardstick.drive)
    assert found.driven[-1].washout.gain == yardstick.gain


def test_screen_and_server_tell_the_same_story(found):
    screened = {trial.washout: trial.rmse for trial in found.screened}
    for trial in found.driven[:DRIVEN]:
        assert trial.rmse == pytest.approx(screened[trial.washout], rel=0.1)


def test_steady_force_ends_as_tilt_and_is_reached_no_faster_than_the_limit():
    screen = Screen(MACHINE, steady(2.0), TUNING, (4.0,), (4.0,), (0.5, 1.0))
    pose, velocity, _ = screen.motion(Washout(4.0, 4.0, 0.5))
    assert pose[-1, 4] == pytest.approx(-0.5 * 0.6 * 2.0 / GRAVITY, rel=1e-3)
    # second-order washout: the place that remains is u / omega^2
    assert pose[-1, 0] == pytest.approx(0.5 * 0.6 * 2.0 / 16.0, rel=1e-3)
    assert np.abs(velocity[:, 4]).max() < TUNING.tilt_rate * 1.15
    assert not pose[:, [1, 2, 3, 5]].any()


def test_sets_that_leave_the_legs_are_left_out():
    screen = Screen(MACHINE, steady(6.0), TUNING, (1.5,), (4.0,), (0.1, 1.0))
    assert screen.judge(Washout(1.5, 4.0, 0.1))[1]
    assert not screen.judge(Washout(1.5, 4.0, 1.0))[1]
    pose = screen.motion(Washout(1.5, 4.0, 1.0))[0]
    legs = own_legs(pose)
    assert (legs < MACHINE.leg_min).any() or (legs > MACHINE.leg_max).any()


def test_drive_of_the_screen_lies_on_its_steps():
    screen = Screen(MACHINE, CURVE, TUNING, (4.0,), (4.0,), (0.5,))
    chosen = Washout(4.0, 4.0, 0.5)
    driven = screen.drive(chosen, 100.0)
    stride = round(0.01 / STEP)
    assert driven.pose == pytest.approx(screen.motion(chosen)[0][::stride], abs=1e-12)
    assert driven.periods is None


def test_nothing_inside_still_gives_an_answer():
    times = np.arange(101) / 100.0
    level, still = np.tile([0.0, 0.0, GRAVITY], (101, 1)), np.zeros(101)
    rolling = from_samples("rolling", times, level, np.tile([3.0, 0.0, 0.0], (101, 1)), still)
    found = find_hindsight(MACHINE, rolling, Tuning(scale=1.0), rate=250.0)
    assert not any(trial.inside for trial in found.screened)
    assert found.by_server
    assert found.best_screen is None
    assert "none inside" in found.described()
