"""Filters of the figures against their formulas."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motionserver.cueing.perception import TELBAN_CARDULLO
from motionserver.evaluate.metrics.linear import bands, lag, low_pass, rms
from motionserver.evaluate.metrics.perceived import perceived, sensed

DT = 0.002
CANALS, OTOLITHS = TELBAN_CARDULLO.roll, TELBAN_CARDULLO.force


def gain_of(filtered, omega, times):
    """Amplitude of ``filtered`` at ``omega`` over the last whole period."""
    last = times > times[-1] - 2.0 * np.pi / omega
    phase = np.exp(-1j * omega * times[last])
    return 2.0 * abs(np.mean(filtered[last] * phase))


def test_lag_answers_a_ramp_exactly():
    times = np.arange(0.0, 2.0, 0.01)
    out = lag(times, 0.3, 0.01)
    assert out == pytest.approx(times - 0.3 * (1.0 - np.exp(-times / 0.3)), abs=1e-12)


def test_lag_begins_settled_and_keeps_a_constant():
    assert lag(np.full((50, 3), 2.5), 5.0, DT) == pytest.approx(np.full((50, 3), 2.5))


@pytest.mark.parametrize(
    ("organ", "omega", "gain"),
    [
        (CANALS, 1.0, 0.985),
        (CANALS, 0.1, 0.493),
        (CANALS, 0.0, 0.0),
        (OTOLITHS, 0.0, 0.4),
        (OTOLITHS, 1.0, 0.788),
    ],
)
def test_organs_have_the_published_gains(organ, omega, gain):
    assert abs(organ.response(omega)) == pytest.approx(gain, abs=6e-4)


@pytest.mark.parametrize("omega", [0.3, 1.0, 5.0])
def test_organs_are_their_published_transfer_functions(omega):
    s = 1j * omega
    canals = 5.73 * 80.0 * s**2 / ((1.0 + 80.0 * s) * (1.0 + 5.73 * s))
    otoliths = 0.4 * (1.0 + 10.0 * s) / ((1.0 + 5.0 * s) * (1.0 + 0.016 * s))
    assert CANALS.response(omega) == pytest.approx(canals)
    assert OTOLITHS.response(omega) == pytest.approx(otoliths)


@pytest.mark.parametrize("organ", [CANALS, OTOLITHS])
def test_simulated_organs_have_their_gain(organ):
    omega = 2.0
    times = np.arange(0.0, 100.0, 0.01)
    felt = sensed(organ, np.sin(omega * times), 0.01)
    assert gain_of(felt, omega, times) == pytest.approx(abs(organ.response(omega)), rel=0.01)


def test_perceived_puts_forces_first():
    force, rates = np.ones((20, 3)), np.ones((20, 3))
    both = perceived(force, rates, DT)
    assert both[:, :3] == pytest.approx(0.4)
    assert both[:, 3:] == pytest.approx(0.0, abs=1e-12)


@given(st.integers(0, 2**32 - 1), st.integers(20, 400))
def test_bands_add_up_to_the_signal(seed, count):
    signal = np.random.default_rng(seed).standard_normal(count)
    assert sum(bands(signal, 0.01, (0.1, 0.5))) == pytest.approx(signal, abs=1e-9)


@pytest.mark.parametrize(
    ("hertz", "shares"),
    [(0.01, (1.0, 0.0, 0.0)), (0.22, (0.04, 0.93, 0.04)), (5.0, (0.0, 0.0, 1.0))],
)
def test_bands_separate_tones_without_delay(hertz, shares):
    times = np.arange(0.0, 100.0, 0.01)
    tone = np.cos(2.0 * np.pi * hertz * times)
    for piece, share in zip(bands(tone, 0.01, (0.1, 0.5)), shares, strict=True):
        assert float(piece @ tone / (tone @ tone)) == pytest.approx(share, abs=0.03)


def test_low_pass_keeps_half_at_its_corner():
    times = np.arange(0.0, 100.0, 0.01)
    tone = np.cos(2.0 * np.pi * 0.5 * times)
    assert rms(low_pass(tone, 0.5, 0.01)) == pytest.approx(0.5 * rms(tone), rel=0.01)


def test_rms_of_a_vector_is_that_of_its_length():
    assert rms(np.array([[3.0, 4.0], [3.0, 4.0]])) == pytest.approx(5.0)
    assert rms(np.array([3.0, -3.0])) == pytest.approx(3.0)
