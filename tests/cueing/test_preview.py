"""A preview that ends, ages, stays away, comes back: no jump but the data's own."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motionserver.core.state import STILL, Preview, Stimulus
from motionserver.cueing.preview import FADE, FRESH
from motionserver.cueing.reference import Reference

PERIOD = 0.01
INSTANTS = np.array([0.05, 0.2, 0.5, 1.0, 2.0])
AMPLITUDE, OMEGA = 3.0, 2.0


def wave(t):
    t = np.asarray(t, dtype=float)
    force = AMPLITUDE * np.stack((np.sin(OMEGA * t), np.cos(OMEGA * t), 0.0 * t), axis=-1)
    return force, 0.1 * force


def told(t, length=3.0, share=1.0):
    times = np.arange(0.05, length + 1e-9, 0.05)
    force, rates = wave(t + times)
    return Preview(times, share * force, share * rates)


def stimulus(t, preview, share=1.0):
    force, rates = wave(t)
    return Stimulus(share * force, share * rates, preview=preview, share=share)


def test_an_aged_preview_is_as_right_as_a_new_one():
    model = Reference("constant", PERIOD, INSTANTS, 0.0)
    preview = told(0.0)
    model.predict(stimulus(0.0, preview))
    for k in range(1, 20):
        # the same packet again in some periods, packets without a preview in others
        out = model.predict(stimulus(k * PERIOD, preview if k < 10 else None))
        truth = wave(k * PERIOD + INSTANTS)[0]
        assert out[:, :2] == pytest.approx(truth[:, :2], abs=0.02)
    assert model.describe() == "preview, then constant"


def test_a_stale_preview_gives_way_to_the_model():
    model = Reference("constant", PERIOD, INSTANTS, 0.0)
    model.predict(stimulus(0.0, told(0.0)))
    for k in range(1, round((FRESH + FADE) / PERIOD) + 3):
        out = model.predict(stimulus(k * PERIOD, None))
        if k == round((FRESH + 0.5 * FADE) / PERIOD):
            assert model.describe().startswith("preview 5")
    assert out[:, :2] == pytest.approx(np.tile(wave(k * PERIOD)[0][:2], (5, 1)))
    assert model.describe() == "constant"


def test_a_preview_told_seldom_is_followed_all_the_time():
    model = Reference("constant", PERIOD, INSTANTS, 0.0)
    for k in range(200):
        out = model.predict(stimulus(k * PERIOD, told(k * PERIOD) if k % 25 == 0 else None))
        assert out[:, 0] == pytest.approx(wave(k * PERIOD + INSTANTS)[0][:, 0], abs=0.03)


def test_how_far_the_future_is_known():
    model = Reference("constant", PERIOD, INSTANTS, 0.1)
    assert model.known == 0.0
    model.predict(stimulus(0.0, told(0.0, 2.0)))
    assert model.known == pytest.approx(1.9)
    for k in range(1, 21):
        model.predict(stimulus(k * PERIOD, None))
    assert model.known == pytest.approx(1.7)
    for k in range(21, 41):
        model.predict(stimulus(k * PERIOD, None))
    assert model.known == 0.0


def test_another_share_since_it_was_told():
    model = Reference("constant", PERIOD, INSTANTS, 0.0)
    model.predict(stimulus(0.0, told(0.0, share=0.5), 0.5))
    out = model.predict(stimulus(PERIOD, None, 0.25))
    assert out[:, 0] == pytest.approx(0.25 * wave(PERIOD + INSTANTS)[0][:, 0], abs=0.01)


def test_nothing_wanted_is_nothing_told_and_the_preview_is_forgotten():
    model = Reference("constant", PERIOD, INSTANTS, 0.0)
    model.predict(stimulus(0.0, told(0.0)))
    assert (model.predict(STILL) == 0.0).all()
    out = model.predict(stimulus(0.02, None))
    assert out[:, 0] == pytest.approx(wave(0.02)[0][0])


def test_a_single_sample_and_one_that_lies_behind():
    model = Reference("constant", PERIOD, INSTANTS, 0.0)
    one = Preview(np.array([0.5]), np.array([[2.0, 0, 0]]), np.zeros((1, 3)))
    still = Stimulus(np.zeros(3), np.zeros(3), preview=one)
    assert model.predict(still)[2, 0] == pytest.approx(2.0)
    behind = replace(still, preview=replace(one, times=np.array([-0.1])))
    assert np.isfinite(model.predict(behind)).all()


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.tuples(st.integers(1, 60), st.booleans()), min_size=2, max_size=8),
    st.floats(0.3, 4.0),
    st.sampled_from(["constant", "fade", "ar"]),
)
def test_bounded_finite_and_continuous_whatever_comes_and_stays_away(spells, length, name):
    model = Reference(name, PERIOD, INSTANTS, 0.0)
    last, k, gap = None, 0, 0
    for periods, with_preview in spells:
        for _ in range(periods):
            preview = told(k * PERIOD, length) if with_preview else None
            out = model.predict(stimulus(k * PERIOD, preview))
            assert np.isfinite(out).all()
            assert np.abs(out[:, :2]).max() < 3.0 * AMPLITUDE + 8.0
            gap += 1
            if last is not None and name != "ar":
                # the data's own slope since the last word, and one step of the weight
                news = min(gap if with_preview else 1, 80)
                step = 2.0 * AMPLITUDE * OMEGA * PERIOD * news + 2.5 * AMPLITUDE * PERIOD / FADE
                assert np.abs(out - last)[:, :2].max() < step
            gap = 0 if with_preview else gap
            last, k = out, k + 1
