import numpy as np
import pytest
from motion_clients.recording import recording_path

from motionserver.core.state import Driver
from motionserver.evaluate.predictions import (
    HORIZONS,
    forecast_errors,
    predictions,
    regular,
    slow_force,
    to_text,
)
from motionserver.evaluate.recording import from_samples, read_recording

TIMES = np.arange(0.0, 20.0, 0.01)


def drive(surge, sway, times=TIMES, speed=15.0):
    force = np.column_stack((surge, sway, np.full(len(times), 9.81)))
    return from_samples("made", times, force, np.zeros((len(times), 3)), np.full(len(times), speed))


def sine(times=TIMES, hertz=0.25):
    return 2.0 * np.sin(2 * np.pi * hertz * times)


def test_expecting_nothing_is_one_and_knowing_is_zero():
    recording = drive(sine(), np.zeros(len(TIMES)))
    ahead = np.array(HORIZONS)
    nothing = forecast_errors(recording, lambda one: np.zeros((len(ahead), 2)), ahead)
    # whole periods are not cut evenly
    assert nothing[0] == pytest.approx(1.0, abs=0.05)
    assert np.isnan(nothing[1]).all()
    known = iter(TIMES)

    def oracle(_):
        future = sine(next(known) + ahead)
        return np.column_stack((future, future))

    # what came is a mean over 0.2 s: 0.4 % less than the sine itself
    assert forecast_errors(recording, oracle, ahead)[0] == pytest.approx(0.0, abs=0.01)


def test_the_constant_is_out_of_step_by_half_a_period():
    recording = drive(sine(), sine())
    result = predictions(recording, ("constant",), horizons=(2.0,))
    assert result.errors[0, 0, 0] == pytest.approx(2.0, abs=0.05)


def test_the_scale_and_the_rate_of_the_recording_hardly_matter():
    recording = drive(sine(), sine())
    coarse = np.arange(0.0, 20.0, 0.025)
    one = predictions(recording, ("ar",))
    scaled = predictions(recording, ("ar",), scale=0.5)
    other = predictions(drive(sine(coarse), sine(coarse), coarse), ("ar",))
    assert scaled.errors == pytest.approx(one.errors, abs=0.05)
    assert other.errors == pytest.approx(one.errors, abs=0.05)


def test_the_mean_of_a_ramp_is_the_ramp():
    slow = slow_force(regular(drive(TIMES, 2 * TIMES)))
    inner = slice(20, -20)
    assert slow[inner] == pytest.approx(np.column_stack((TIMES, 2 * TIMES))[inner])


def test_drivers_are_taken_at_their_own_samples():
    coarse = np.arange(0.0, 12.0, 0.02)
    recording = drive(sine(coarse), sine(coarse), coarse)
    drivers = [Driver(0.5, 0.0, 0.0, 0.0, 1)] * len(coarse)
    assert np.isfinite(predictions(recording, ("vehicle",), drivers=drivers).errors).all()
    with pytest.raises(ValueError, match="1 drivers for 600 samples"):
        predictions(recording, ("vehicle",), drivers=drivers[:1])


def test_the_table():
    result = predictions(drive(sine(), np.zeros(len(TIMES))), ("constant", "ar"))
    text = to_text(result)
    lines = text.splitlines()
    assert lines[0].startswith("made: ")
    assert lines[2].split() == [
        "surge",
        *[f"{h:.2f}" for h in HORIZONS],
        "sway",
        *lines[2].split()[8:],
    ]
    name, *cells = lines[3].split()
    assert name == "constant"
    assert cells[:6] == [f"{value:.2f}" for value in result.errors[0, 0]]
    assert cells[6:] == ["-"] * 6
    assert text.endswith("\n")


def test_standstill_pays_on_the_drive_with_two_stops():
    """The constant is worse than nothing at two seconds; "ar" knows that brakes end at a stop."""
    recording = read_recording(recording_path("truck_brake_accel")).excerpt(0.0, 60.0)
    result = predictions(recording, ("constant", "ar"), horizons=(1.0, 2.0))
    constant, ar = result.errors[:, 0]
    assert (ar < 0.9 * constant).all()
