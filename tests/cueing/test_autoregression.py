import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motionserver.cueing.autoregression import LARGEST_TRACE, AutoRegression


def feed(model, signal):
    for k in range(model.order, len(signal)):
        model.learn(signal[k - model.order : k][::-1], signal[k])


def test_starts_as_constant():
    model = AutoRegression(4)
    assert model.forecast_matrix(3) @ np.array([2.0, 1.0, 0.0, 5.0]) == pytest.approx([2, 2, 2])


def test_learns_a_sine():
    step = 0.05
    signal = np.sin(2 * np.pi * 0.3 * step * np.arange(400))
    model = AutoRegression(2)
    feed(model, signal)
    ahead = model.forecast_matrix(20) @ signal[-1:-3:-1]
    truth = np.sin(2 * np.pi * 0.3 * step * np.arange(400, 420))
    assert ahead == pytest.approx(truth, abs=0.12)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 1000), st.floats(0.9, 1.3))
def test_forecasts_never_explode(seed, growth):
    rng = np.random.default_rng(seed)
    signal = np.clip(growth ** np.arange(60) * rng.normal(size=60), -1e3, 1e3)
    model = AutoRegression(4)
    feed(model, signal)
    roots = np.roots(np.concatenate(([1.0], -model.stable_weights())))
    assert np.abs(roots).max() <= 1.0 + 1e-6


def test_standing_still_does_not_wind_up():
    model = AutoRegression(4)
    feed(model, np.zeros(5000))
    assert np.trace(model.covariance) <= LARGEST_TRACE * (1 + 1e-9)
    feed(model, np.sin(np.arange(50)))
    assert np.isfinite(model.weights).all()


def test_covariance_stays_symmetric_and_positive():
    model = AutoRegression(8)
    feed(model, np.random.default_rng(3).normal(size=2000))
    assert model.covariance == pytest.approx(model.covariance.T)
    assert np.linalg.eigvalsh(model.covariance).min() > 0


def test_ignores_what_is_no_number():
    model = AutoRegression(2)
    model.learn(np.array([np.nan, 1.0]), 1.0)
    model.learn(np.array([1.0, 1.0]), np.inf)
    assert model.weights == pytest.approx([1.0, 0.0])
