"""The motion-sickness weighting against the published table."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motionserver.evaluate.tune.sickness import weighted_rms, weighting

# nominal third-octave frequency [Hz] and W_f as printed in ISO 2631-1:1997, Table 3
TABLE = {
    0.1: 0.695, 0.125: 0.895, 0.16: 1.006, 0.2: 0.992, 0.25: 0.854, 0.315: 0.619, 0.4: 0.384,
    0.5: 0.224, 0.63: 0.116, 0.8: 0.053, 1.0: 0.0235,
}  # fmt: skip


@pytest.mark.parametrize(("frequency", "weight"), TABLE.items())
def test_weight_is_the_published_one(frequency, weight):
    got = abs(weighting(np.array([frequency])))[0]
    assert got == pytest.approx(weight, rel=0.003)  # the table has three digits


def test_nothing_counts_at_rest_and_far_above():
    assert weighting(np.zeros(1))[0] == 0.0
    assert abs(weighting(np.array([5.0])))[0] < 1e-4


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_long_sine_keeps_its_weight(axis):
    dt, frequency = 0.02, 0.2
    times = np.arange(0.0, 2000.0, dt)
    force = np.zeros((len(times), 3))
    force[:, axis] = 1.5 * np.sin(2.0 * np.pi * frequency * times)
    assert weighted_rms(force, dt) == pytest.approx(1.5 / np.sqrt(2.0) * 0.992, rel=0.005)


@given(offset=st.floats(-5.0, 5.0), factor=st.floats(0.0, 3.0))
def test_offset_says_nothing_and_size_counts_linearly(offset, factor):
    times = np.arange(0.0, 30.0, 0.05)
    force = np.column_stack([np.sin(times), np.cos(1.3 * times), 0.2 * np.sin(2.1 * times)])
    plain = weighted_rms(force, 0.05)
    assert weighted_rms(factor * force + offset, 0.05) == pytest.approx(factor * plain, abs=1e-9)
