"""Lateness: recent percentiles, the whole run's tail, lost slots."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motionserver.telemetry.histogram import Histogram
from motionserver.telemetry.ticker import Lateness, ticks_per_send

MS = 1_000_000


def test_nothing_ticked_is_all_zero():
    summary = Lateness(MS).summary()
    assert summary["late_max_ms"] == summary["late_p999_ms"] == summary["missed"] == 0


def test_a_tick_one_and_a_half_periods_late_lost_one_slot():
    late = Lateness(4 * MS)
    late.ticked(6 * MS)
    late.ticked(3 * MS)
    assert late.summary()["missed"] == 1
    assert late.summary()["late_max_ms"] == 6.0


def test_an_old_stall_leaves_the_recent_figures_and_stays_in_the_histogram():
    late = Lateness(4 * MS, keep=100)
    late.ticked(50 * MS)
    for _ in range(300):
        late.ticked(MS // 10)
    summary = late.summary()
    assert summary["late_max_ms"] < 1.0
    assert summary["ticks"] == 301
    whole = Histogram.from_mapping(summary["late_bins"])
    assert whole.total == 301
    assert whole.percentile(1.0) > 40 * MS


@given(st.lists(st.integers(-MS, 100 * MS), min_size=1, max_size=300))
def test_percentiles_never_exceed_the_largest(values):
    late = Lateness(4 * MS)
    for value in values:
        late.ticked(value)
    summary = late.summary()
    assert summary["late_p50_ms"] <= summary["late_p99_ms"] <= summary["late_max_ms"]


@pytest.mark.parametrize(
    ("rate_hz", "ticks"), [(1, 240), (60, 4), (100, 3), (120, 2), (200, 2), (240, 1), (1000, 1)]
)
def test_a_guard_ticks_at_the_smallest_multiple_that_is_fast_enough(rate_hz, ticks):
    assert ticks_per_send(rate_hz) == ticks
    assert ticks_per_send(1.0 / (1.0 / rate_hz)) == ticks
