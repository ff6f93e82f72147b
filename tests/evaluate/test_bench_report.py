"""Percentiles of benchmarks: exact on samples, to a few per cent on histograms."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from motionserver.evaluate.bench.report import (
    describe_machine,
    machine_text,
    row_of_histogram,
    row_of_samples,
    table_text,
)
from motionserver.telemetry.histogram import BINS, Histogram, bin_of, middle_of

durations = st.lists(st.integers(0, 10_000_000_000), min_size=1, max_size=400)
COARSE = 1 / 32
UNIT = 64


def counted(values):
    out = Histogram()
    for value in values:
        out.add(value)
    return out


@given(durations, st.floats(0.001, 1.0))
def test_a_percentile_of_the_histogram_is_that_of_the_values_to_within_its_bin(values, share):
    # the rank is what both agree on; a share on the edge of two ranks may round to either
    rank = max(1, math.ceil(share * len(values) - 1e-9))
    exact = np.sort(values)[rank - 1]
    assert abs(counted(values).percentile(share) - exact) <= COARSE * exact + UNIT


@given(durations)
def test_percentiles_of_samples_are_numpys(values):
    row = row_of_samples("x", values)
    wanted = np.quantile(np.array(values) / 1e6, [0.5, 0.9, 0.99, 0.999], method="inverted_cdf")
    np.testing.assert_allclose([row.p50_ms, row.p90_ms, row.p99_ms, row.p999_ms], wanted, atol=1e-4)
    assert row.count == len(values)


@given(durations)
def test_percentiles_are_ordered_whatever_they_come_from(values):
    for row in (row_of_samples("x", values), row_of_histogram("x", counted(values))):
        cuts = [row.p50_ms, row.p90_ms, row.p99_ms, row.p999_ms, row.max_ms]
        assert cuts == sorted(cuts)
        assert all(math.isfinite(cut) for cut in cuts)


@given(st.integers(0, BINS - 1))
def test_the_middle_of_a_bin_lies_in_it(index):
    assert bin_of(int(middle_of(index))) == index


@given(st.integers(-(10**6), 10**15))
def test_bins_grow_with_their_values(value):
    assert 0 <= bin_of(value) <= bin_of(value + 1) < BINS


@given(durations, durations)
def test_a_stretch_is_the_difference_of_two_readings(before, during):
    first = counted(before)
    both = counted(before + during)
    assert both.since(first).counts == counted(during).counts
    assert first.plus(counted(during)).counts == both.counts


@given(durations)
def test_a_histogram_survives_json(values):
    one = counted(values)
    assert Histogram.from_mapping(one.to_mapping()).counts == one.counts


def test_nothing_counted_is_nothing():
    assert Histogram().percentile(0.5) == 0.0
    assert row_of_samples("x", []).count == 0


def test_the_table_names_rows_and_notes():
    text = table_text("times", [row_of_samples("one", [1_000_000], missed=3)])
    assert "one" in text
    assert "missed 3" in text
    assert "1.000" in text


def test_the_machine_is_described():
    machine = describe_machine()
    assert machine["cores"] >= 1
    assert str(machine["cores"]) in machine_text(machine)
