import numpy as np
import pytest

from .signals import correlation, derivative, integral, lowpass, slow_part, still, uniform


def tone(t, hertz):
    return np.sin(2.0 * np.pi * hertz * t)


def size(x):
    """Amplitude away from the ends."""
    return float(np.sqrt(2.0) * np.std(x[300:-300]))


def test_uniform_slow_source_has_little_above_its_nyquist_frequency():
    t = np.arange(0.0, 60.0, 0.1)
    out = uniform(t, tone(t, 1.0) + tone(t, 3.0), np.arange(0.0, 59.0, 0.01))
    above = out - lowpass(out, 5.0)
    assert size(above) < 0.15 * size(out)


def test_uniform_fast_source_keeps_8_hz():
    t = np.arange(0.0, 60.0, 1.0 / 120.0)
    out = uniform(t, tone(t, 8.0), np.arange(0.0, 59.0, 0.01))
    assert size(out) == pytest.approx(1.0, abs=0.02)


def test_uniform_fast_source_does_not_alias():
    t = np.arange(0.0, 60.0, 1.0 / 400.0)
    out = uniform(t, tone(t, 95.0), np.arange(0.0, 59.0, 0.01))
    assert size(out) < 0.05


def test_uniform_times_going_back_are_an_error():
    with pytest.raises(ValueError, match="increase"):
        uniform(np.array([0.0, 0.2, 0.1]), np.zeros(3), np.array([0.0, 0.1]))


def test_lowpass_has_no_phase():
    t = np.arange(0.0, 60.0, 0.01)
    out = lowpass(tone(t, 0.2), 0.5)
    lag = np.argmax([np.dot(out[500:-500], np.roll(tone(t, 0.2), k)[500:-500]) for k in range(100)])
    assert lag == 0


def test_correlation_worked_by_hand():
    # (1, 2, 4) on (0, 1, 2): deviations (-4/3, -1/3, 5/3) and (-1, 0, 1): 3 / sqrt(42/9 * 2), 3/2
    r, gain = correlation(np.array([1.0, 2.0, 4.0]), np.array([0.0, 1.0, 2.0]))
    assert r == pytest.approx(3.0 / np.sqrt(28.0 / 3.0))
    assert gain == pytest.approx(1.5)


def test_correlation_of_a_constant_is_zero():
    assert correlation(np.ones(5), np.arange(5.0)) == (0.0, 0.0)


def test_still_short_stop_and_rolling_out_do_not_count():
    v = np.full(2000, 5.0)
    v[200:400] = 0.0
    v[800:1500] = 0.0
    rest = still(v)
    assert not rest[:850].any()
    assert rest[900:1400].all()
    assert not rest[1450:].any()


def test_slow_part_follows_drift_and_not_bends():
    t = np.arange(0.0, 120.0, 0.01)
    drift = 0.3 + 0.01 * t - 5e-5 * t**2
    assert np.allclose(slow_part(drift, 20.0), drift, atol=1e-6)
    assert size(slow_part(tone(t, 0.3), 20.0)) < 0.05


def test_integral_undoes_derivative():
    t = np.arange(0.0, 20.0, 0.01)
    assert np.allclose(integral(derivative(tone(t, 0.3))), tone(t, 0.3), atol=1e-3)
