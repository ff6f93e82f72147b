from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motionserver.core.state import Driver, Preview, Stimulus
from motionserver.cueing.predictor import FEATURES, Predictor, save
from motionserver.cueing.reference import MODELS, Reference, believable
from motionserver.cueing.reference_base import HEAVE_FADE, RATE_FADE

TIMES = np.array([0.01, 0.1, 0.5, 1.0, 2.0])


def stimulus(force=(1.0, 2.0, 3.0), rates=(0.1, 0.2, 0.3), preview=None):
    return Stimulus(np.array(force), np.array(rates), 1.0, preview)


def test_constant_holds_surge_and_sway_and_fades_heave():
    out = Reference("constant", 0.01, TIMES, 0.0).predict(stimulus())
    assert out[:, 0] == pytest.approx(np.full(5, 1.0))
    assert out[:, 1] == pytest.approx(np.full(5, 2.0))
    assert out[:, 2] == pytest.approx(3.0 * np.exp(-TIMES / HEAVE_FADE))
    assert (np.diff(out[:, 3:], axis=0) < 0).all()


def test_fade():
    out = Reference("fade", 0.01, TIMES, 0.0).predict(stimulus())
    assert out[:, 0] == pytest.approx(np.exp(-TIMES))


def test_ar_begins_at_now_and_is_bounded():
    model = Reference("ar", 0.01, TIMES, 0.0)
    rng = np.random.default_rng(0)
    for _ in range(500):
        out = model.predict(stimulus(force=5.0 * rng.normal(size=3)))
        assert (np.abs(out[-1, :2]) < 8.5).all()
    out = model.predict(stimulus(force=(4.0, -4.0, 0.0)))
    assert out[0, 0] == pytest.approx(4.0, abs=0.6)
    assert out[0, 1] == pytest.approx(-4.0, abs=0.6)


def test_ar_beats_constant_on_a_slalom():
    lead, ahead = 0.01, np.array([0.5])
    wave = lambda t: 3.0 * np.sin(2 * np.pi * 0.3 * t)  # noqa: E731
    errors = {}
    for name in ("ar", "constant"):
        model, error = Reference(name, 0.01, ahead, lead), []
        for k in range(4000):
            t = 0.01 * k
            out = model.predict(stimulus(force=(0.0, wave(t), 0.0)))
            if k > 2000:
                error.append(out[0, 1] - wave(t + ahead[0] + lead))
        errors[name] = np.sqrt(np.mean(np.square(error)))
    assert errors["ar"] < 0.5 * errors["constant"]


def test_ar_survives_what_is_no_number():
    model = Reference("ar", 0.01, TIMES, 0.0)
    model.predict(stimulus(force=(np.nan, 0.0, 0.0)))
    for _ in range(20):
        out = model.predict(stimulus())
    assert np.isfinite(out).all()


def test_preview_is_followed_exactly_then_passes_into_the_model():
    times = np.array([0.0, 0.5, 1.0])
    force = np.array([[1.0, 0, 0], [2.0, 0, 0], [5.0, 0, 0]])
    preview = Preview(times, force, np.zeros((3, 3)))
    out = Reference("constant", 0.01, np.array([0.25, 0.75, 1.0, 20.0]), 0.0).predict(
        stimulus(preview=preview)
    )
    assert out[:3, 0] == pytest.approx([1.5, 3.5, 5.0])
    assert out[3, 0] == pytest.approx(1.0, abs=1e-6)


def test_preview_that_begins_later_is_joined_to_now():
    preview = Preview(np.array([1.0]), np.array([[3.0, 0, 0]]), np.zeros((1, 3)))
    out = Reference("constant", 0.01, np.array([0.5]), 0.0).predict(stimulus(preview=preview))
    assert out[0, 0] == pytest.approx(2.0)


def test_lead_is_counted():
    preview = Preview(np.array([0.0, 1.0]), np.array([[0.0] * 3, [1.0] * 3]), np.zeros((2, 3)))
    out = Reference("constant", 0.01, np.array([0.3]), 0.2).predict(
        stimulus(force=(0.0, 0.0, 0.0), preview=preview)
    )
    assert out[0, 0] == pytest.approx(0.5)


def test_unknown_model():
    with pytest.raises(ValueError, match="constant, fade, ar, vehicle, learned"):
        Reference("oracle", 0.01, TIMES, 0.0)


@pytest.fixture(scope="module")
def predictor(tmp_path_factory):
    """A file for the model "learned"."""
    path = tmp_path_factory.mktemp("predictor") / "drawn.json"
    weights = 0.05 * np.random.default_rng(0).normal(size=(2, 3, FEATURES))
    save(Predictor("drawn", np.array([0.25, 1.0, 2.0]), weights, {"note": "drawn"}), path)
    return str(path)


@pytest.mark.parametrize("name", MODELS)
def test_every_model_begins_at_now_and_fades_heave_and_roll(name, predictor):
    model = Reference(name, 0.01, np.append(1e-6, TIMES), 0.0, predictor)
    for _ in range(50):
        out = model.predict(Stimulus(np.array([1.0, -2.0, 3.0]), np.full(3, 0.1), speed=10.0))
    assert out[0] == pytest.approx([1.0, -2.0, 3.0, 0.1, 0.1, 0.1], abs=0.02)
    assert out[1:, 2] == pytest.approx(3.0 * np.exp(-TIMES / HEAVE_FADE))
    assert out[1:, 3:5] == pytest.approx(0.1 * np.exp(-TIMES / RATE_FADE)[:, None] * np.ones(2))
    assert model.describe().startswith(name)


@settings(max_examples=15, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    name=st.sampled_from(MODELS),
    share=st.sampled_from([0.0, 0.03, 0.6, 1.0]),
)
def test_jumps_and_nonsense_leave_every_model_finite_and_bounded(predictor, seed, name, share):
    rng = np.random.default_rng(seed)
    model = Reference(name, 0.01, TIMES, 0.01, predictor)
    for k in range(300):
        wild = rng.choice([0.0, 1.0, 1e6, np.nan, -np.inf], p=[0.3, 0.6, 0.04, 0.03, 0.03])
        with np.errstate(invalid="ignore"):  # nothing times infinity is no number either
            force = 5.0 * share * rng.normal(size=3) * (wild if k % 50 == 0 else 1.0)
        said = Stimulus(
            force,
            share * rng.normal(size=3),
            share=share,
            speed=30.0 * rng.normal() * wild,
            driver=Driver(*np.abs(rng.normal(size=3)) * wild, rng.normal() * wild, 1),
        )
        believed = believable(said)
        if believed is None:
            continue
        out = model.predict(believed)
        assert np.isfinite(out).all()
        assert np.abs(out).max() < 200.0
    # and they come to their senses
    for _ in range(600):
        out = model.predict(Stimulus(np.array([1.0, 0.0, 0.0]), np.zeros(3), share=share))
    assert np.abs(out[:, :2]).max() < 10.0


def test_what_a_sender_does_not_tell_or_tells_as_nonsense():
    said = Stimulus(np.zeros(3), np.zeros(3), share=np.nan, speed=np.inf)
    believed = believable(replace(said, driver=Driver(0.0, np.nan, 0.0, 0.0, 1)))
    assert (believed.share, believed.speed, believed.driver) == (0.0, 0.0, None)
    bounded = believable(replace(said, driver=Driver(2.0, -1.0, 0.5, 1e3, 1))).driver
    assert (bounded.throttle, bounded.brake, bounded.clutch, bounded.steering) == (1, 0, 0.5, 20)
