"""Alive or stale, by arrival only."""

from itertools import accumulate

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motionserver.core.intake.freshness import MS, SECOND_NS, Freshness


def after(*gaps_ms: float, look: float = 0.0) -> tuple[Freshness, int]:
    fresh = Freshness(int(look * MS))
    times = [int(t * MS) for t in accumulate((1000.0, *gaps_ms))]
    for time in times:
        fresh.arrived(time)
    return fresh, times[-1]


def test_nothing_has_come() -> None:
    fresh = Freshness()
    assert fresh.newest_ns is None
    assert fresh.age_ns(5) is None
    assert fresh.is_stale(5)
    assert fresh.rate_hz() == 0.0


@pytest.mark.parametrize(
    ("gaps", "interval", "stale_after"),
    [
        ([], 100, 300),
        ([10], 100, 300),
        ([10, 10], 10, 50),
        ([10, 10, 10], 10, 50),
        ([1, 1, 1], 5, 50),
        ([20] * 5, 20, 60),
        ([10, 15, 20, 30, 40], 20, 60),
        ([20, 20, 200, 20, 20], 20, 60),
        ([400, 400, 100], 100, 300),
    ],
)
def test_median_interval_and_stale_rule(
    gaps: list[float], interval: float, stale_after: float
) -> None:
    fresh, now = after(*gaps)
    assert fresh.interval_ns() == interval * MS
    assert fresh.stale_after_ns() == stale_after * MS
    assert not fresh.is_stale(now + int(stale_after * MS))
    assert fresh.is_stale(now + int(stale_after * MS) + 1)


@pytest.mark.parametrize(
    ("look", "gaps", "interval"),
    [
        (33, [0, 33] * 5, 33),
        (33, [0, 0, 33] * 5, 33),
        (33, [50] * 5, 50),
        (10, [0, 10] * 5, 10),
        (4, [1] * 5, 5),
        (120, [0, 120] * 3, 100),
    ],
)
def test_packets_that_are_read_together_did_not_come_together(look, gaps, interval):
    fresh, _ = after(*gaps, look=look)
    assert fresh.interval_ns() == interval * MS


def test_only_the_last_second_counts() -> None:
    fresh, now = after(*[100.0] * 10, *[10.0] * 100)
    assert fresh.interval_ns() == 10 * MS
    assert fresh.rate_hz() == pytest.approx(100.0)
    fresh.arrived(now + 2 * SECOND_NS)
    assert fresh.interval_ns() == 100 * MS
    assert fresh.rate_hz() == 0.0


def test_a_packet_exactly_a_second_old_still_counts() -> None:
    fresh, now = after(1000.0)
    assert fresh.rate_hz() == 1.0
    fresh.arrived(now + 1)
    assert fresh.rate_hz() == pytest.approx(1e9), "only the last two are left"


def test_two_packets_have_a_rate_even_when_two_more_came_together() -> None:
    assert after(20.0)[0].rate_hz() == pytest.approx(50.0)
    assert after(0.0, 10.0)[0].rate_hz() == pytest.approx(200.0)


def test_of_a_flood_the_newest_1024_packets_are_kept() -> None:
    assert after(10.0, *[0.0] * 1022)[0].rate_hz() == pytest.approx(102_300.0)
    assert after(10.0, *[0.0] * 1023)[0].rate_hz() == 0.0


def test_bursts_at_one_instant_have_no_rate() -> None:
    fresh, now = after(0.0, 0.0)
    assert fresh.rate_hz() == 0.0
    assert fresh.age_ns(now + 7) == 7


@given(st.lists(st.integers(0, 3 * SECOND_NS), min_size=1, max_size=60))
def test_patience_is_always_between_50_and_300_ms(gaps: list[int]) -> None:
    fresh = Freshness()
    for time in accumulate(gaps):
        fresh.arrived(time)
        assert 50 * MS <= fresh.stale_after_ns() <= 300 * MS
        assert not fresh.is_stale(time)


def test_the_usual_gap_is_the_median_and_never_nothing() -> None:
    assert Freshness().usual_gap() == 1e-6
    assert after(0.0, 0.0)[0].usual_gap() == 1e-6
    assert after(10.0, 20.0, 400.0)[0].usual_gap() == 0.020
    assert after(*[400.0] * 4, *[10.0] * 4)[0].usual_gap() == 0.400
    assert after(*[400.0] * 4, *[10.0] * 5)[0].usual_gap() == 0.010


@pytest.mark.parametrize(
    ("gap", "is_slow"), [(200, False), (220, False), (221, True), (1000, True)]
)
def test_five_packets_a_second_are_needed(gap: float, is_slow: bool) -> None:
    assert after(*[gap] * 5)[0].is_too_slow is is_slow


def test_three_gaps_tell_that_a_source_is_slow_and_four_of_the_last_eight() -> None:
    assert not Freshness().is_too_slow
    assert not after(400.0, 400.0)[0].is_too_slow
    assert after(400.0, 400.0, 400.0)[0].is_too_slow
    assert not after(*[10.0] * 20, *[400.0] * 3)[0].is_too_slow
    assert after(*[10.0] * 20, *[400.0] * 4)[0].is_too_slow
    assert not after(*[10.0] * 20, 400.0, 10.0)[0].is_too_slow, "an outage is no rate"


def test_the_newest_packet_is_the_one_that_came_last() -> None:
    fresh, now = after(10.0, 20.0, 30.0)
    assert fresh.newest_ns == now == 1060 * MS
