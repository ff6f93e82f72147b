"""Figures on signals whose answer is known."""

import numpy as np
import pytest

from motionserver.evaluate.metrics.comfort import (
    comfort_figures,
    rating,
    tilt_rate,
    washout_against,
)
from motionserver.evaluate.metrics.fidelity import axis_figures, cue_indices

DT = 0.002
TIMES = np.arange(0.0, 40.0, DT)
WANTED = 2.0 * np.sin(2.0 * np.pi * 0.25 * TIMES)


def judged(felt, wanted=WANTED, threshold=0.1):
    return axis_figures("f_x", wanted, felt, wanted, felt, DT, threshold)


def test_perfect_motion_has_no_error():
    figures = judged(WANTED)
    assert figures.rmse == 0.0
    assert figures.nrmse == 0.0
    assert figures.correlation == pytest.approx(1.0)
    assert figures.lag == 0.0
    assert figures.gain == pytest.approx(1.0)
    assert figures.r2 == pytest.approx(1.0)
    assert figures.false_cue == 0.0
    assert figures.missing_cue == 0.0


def test_no_motion_is_one_everywhere():
    figures = judged(np.zeros_like(WANTED))
    assert figures.wanted_rms == pytest.approx(np.sqrt(2.0))
    assert figures.rmse == pytest.approx(np.sqrt(2.0))
    for share in (figures.nrmse, figures.nrmse_mid, figures.nrmse_onset, figures.perceived_nrmse):
        assert share == pytest.approx(1.0)
    assert figures.correlation is None
    assert figures.lag is None
    assert figures.gain is None
    assert figures.false_share == 0.0
    assert figures.missing_cue == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("delay", [-0.1, 0.05, 0.3, 0.8])
@pytest.mark.parametrize("gain", [0.4, 1.2])
def test_delay_and_gain_are_found(delay, gain):
    # two tones, so that a delay is not a period
    def signal(times):
        return np.sin(2.0 * np.pi * 0.23 * times) + 0.5 * np.cos(2.0 * np.pi * 0.71 * times)

    figures = judged(gain * signal(TIMES - delay), signal(TIMES))
    assert figures.lag == pytest.approx(delay, abs=0.005)
    assert figures.lag_correlation == pytest.approx(1.0, abs=1e-3)
    assert figures.gain == pytest.approx(gain, rel=0.01)
    assert figures.r2 == pytest.approx(1.0, abs=1e-3)


def test_opposite_motion_is_a_false_cue():
    figures = judged(-WANTED)
    assert figures.nrmse == pytest.approx(2.0)
    assert figures.correlation == pytest.approx(-1.0)
    assert figures.false_cue == pytest.approx(1.0, abs=0.01)
    assert figures.false_share == pytest.approx(1.0, abs=0.05)


def test_cue_out_of_nothing_is_false_and_small_motion_is_missing():
    wanted = np.array([0.0, 0.0, 1.0, 1.0])
    felt = np.array([0.5, 0.05, 0.05, 0.5])
    false, share, missing = cue_indices(wanted, felt, 0.1)
    assert false == pytest.approx(0.5 / 2.0)
    assert share == pytest.approx(0.25)
    assert missing == pytest.approx(1.0 / 2.0)


def test_axis_on_which_nothing_is_wanted_has_no_ratios():
    figures = judged(0.5 * np.ones_like(TIMES), np.zeros_like(TIMES))
    assert figures.rmse == pytest.approx(0.5)
    assert figures.nrmse is None
    assert figures.lag is None
    assert figures.false_cue is None
    assert figures.false_share == 1.0


def test_rating_weighs_lateral_two_thirds_and_settles_in_a_second():
    error = np.zeros((5000, 3))
    error[:, 1] = -1.0
    rated = rating(error, DT)
    assert rated[500] == pytest.approx(0.66 * (1.0 - np.exp(-1.0)), rel=0.01)
    assert rated[-1] == pytest.approx(0.66, rel=0.01)
    assert rating(error[:, [1, 0, 2]], DT)[-1] == pytest.approx(0.34, rel=0.01)


def test_tilt_rate_is_what_goes_beyond_the_wanted_turn():
    wanted = np.radians([[5.0, 0.0, 0.0], [5.0, 0.0, 0.0], [5.0, 0.0, 0.0], [0.0, -2.0, 0.0]])
    felt = np.radians([[4.0, 0.0, 9.0], [8.0, 4.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -3.0, 0.0]])
    assert np.degrees(tilt_rate(wanted, felt)) == pytest.approx([0.0, 5.0, 1.0, 1.0])


def test_washout_against_the_cue_counts_opposite_acceleration_only():
    wanted = np.array([[1.0, -1.0, 0.0], [1.0, 0.0, 0.0]])
    acceleration = np.array([[-0.5, -0.7, 0.0, 0.0, 0.0, 0.0], [0.3, 4.0, 0.0, 0.0, 0.0, 0.0]])
    assert washout_against(wanted, acceleration) == pytest.approx(
        np.array([[0.5, 0.0], [0.0, 0.0]])
    )


def test_comfort_figures_sum_up():
    count = len(TIMES)
    rates = np.zeros((count, 3))
    rates[: count // 4, 1] = np.radians(4.0)
    force = np.column_stack((np.ones(count), np.zeros(count), np.zeros(count)))
    acceleration = np.zeros((count, 6))
    acceleration[: count // 2, 0] = -0.2
    figures = comfort_figures(force, np.zeros((count, 3)), force, rates, acceleration, DT)
    assert figures.rating_peak == 0.0
    assert np.degrees(figures.tilt_rate_max) == pytest.approx(4.0)
    assert figures.tilt_share == pytest.approx(0.25)
    assert figures.washout_max == pytest.approx(0.2)
    assert figures.washout_share == pytest.approx(0.5)
