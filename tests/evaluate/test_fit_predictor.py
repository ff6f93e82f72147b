import numpy as np
import pytest

from motionserver.cueing.predictor import check, load, save
from motionserver.cueing.reference import Reference
from motionserver.evaluate.fit_predictor import FIT_HORIZONS, fit
from motionserver.evaluate.predictions import errors_of, forecast_errors
from motionserver.evaluate.recording import from_samples

AHEAD = np.array([0.5, 1.0])
TIMES = np.arange(0.0, 30.0, 0.01)


def pulses(seed, name="made", seconds=30.0):
    """Surge in pulses that always last one second and are announced by the pitch rate."""
    rng = np.random.default_rng(seed)
    times = np.arange(0.0, seconds, 0.01)
    surge, pitch = np.zeros(len(times)), np.zeros(len(times))
    k = 200
    while k < len(times) - 300:
        size = rng.choice([-1, 1]) * rng.uniform(1.0, 3.0)
        surge[k : k + 100] = size
        pitch[k - 80 : k - 20] = 0.1 * size
        k += int(rng.uniform(250, 400))
    box = np.ones(20) / 20
    surge, pitch = np.convolve(surge, box, "same"), np.convolve(pitch, box, "same")
    zero = np.zeros(len(times))
    force = np.column_stack((surge, 0.3 * surge, zero + 9.81))
    rates = np.column_stack((zero, pitch, zero))
    return from_samples(name, times, force, rates, zero + 20.0)


@pytest.fixture(scope="module")
def fitted():
    return fit([pulses(seed, f"drive {seed}") for seed in range(8)], "pulses", "made up")


def test_it_finds_what_the_autoregressive_model_cannot_know(fitted):
    unseen = pulses(99)
    ar = forecast_errors(unseen, Reference("ar", 0.01, AHEAD, 0.0).predict, AHEAD)
    learned = errors_of(unseen, fitted, AHEAD)
    assert (learned[0] < 0.85 * ar[0]).all()


def test_it_tells_where_it_is_from(fitted, tmp_path):
    told = fitted.provenance
    assert list(told["recordings"]) == [f"drive {seed}" for seed in range(8)]
    assert told["note"] == "made up"
    errors = told["left_out"]["drive 3"]["surge"]
    assert len(errors["ar"]) == len(errors["learned"]) == len(FIT_HORIZONS)
    assert np.mean(errors["learned"]) < np.mean(errors["ar"])
    save(fitted, tmp_path / "p.json")
    assert load(tmp_path / "p.json").provenance == told


def test_noise_that_holds_nowhere_else_is_no_correction():
    rng = np.random.default_rng(0)

    def noise(name):
        slow = np.cumsum(rng.normal(size=(len(TIMES), 3)), axis=0)
        slow -= slow.mean(axis=0)
        force = slow / np.abs(slow).max() + np.array([0.0, 0.0, 9.81])
        return from_samples(name, TIMES, force, 0.1 * rng.normal(size=force.shape), TIMES * 0.0)

    drives = [noise(name) for name in "abc"]
    fitted = fit(drives, "noise")
    unseen = noise("d")
    ar = forecast_errors(unseen, Reference("ar", 0.01, AHEAD, 0.0).predict, AHEAD)
    assert (errors_of(unseen, fitted, AHEAD) < 1.15 * ar).all()


def test_one_recording_is_judged_by_its_quarters():
    fitted = fit([pulses(5, seconds=60.0)], "one")
    check(fitted, "here")
    names = list(fitted.provenance["left_out"])
    assert names == [f"made, part {k} of 4" for k in range(1, 5)]


def test_what_cannot_be_fitted_to():
    with pytest.raises(ValueError, match="at least one"):
        fit([], "none")
    with pytest.raises(ValueError, match="too short"):
        fit([pulses(0).excerpt(0.0, 9.0), pulses(1)], "short")
