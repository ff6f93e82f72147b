"""The grid of ticks and packets: even when served in time, never two packets close together."""

from collections.abc import Callable
from itertools import pairwise
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motionserver.guard.send_grid import SendGrid

SECOND = 1e9
RATES = [(SECOND / 240, 4), (SECOND / 250, 1), (SECOND / 1000, 1)]


@pytest.mark.parametrize(("tick_ns", "ticks"), RATES)
def test_a_grid_that_is_served_in_time_keeps_the_nominal_rate(tick_ns: float, ticks: int) -> None:
    now, random = 10**15, Random(1)
    grid = SendGrid(tick_ns, ticks, now)
    sent: list[int] = []
    now = grid.first_tick(now)
    while len(sent) < 10_000:
        woken = now + int(random.uniform(0.0, 0.1) * tick_ns)
        if grid.is_due(woken):
            assert grid.take(woken) == 0
            sent.append(woken)
            grid.keep_apart(woken)
        now = grid.next_tick(woken)
        assert woken < now <= woken + 1.01 * tick_ns
    assert sent[-1] - sent[0] == pytest.approx(9_999 * ticks * tick_ns, abs=tick_ns)


def served(grid: SendGrid, start: int, lateness: Callable[[], int], count: int) -> list[int]:
    sent: list[int] = []
    now = grid.first_tick(start)
    while len(sent) < count:
        woken = now + lateness()
        if grid.is_due(woken):
            grid.take(woken)
            sent.append(woken)
            grid.keep_apart(woken)
        now = grid.next_tick(woken)
    return sent


@pytest.mark.parametrize(("tick_ns", "ticks"), RATES)
def test_a_grid_that_is_served_late_never_brings_packets_close(tick_ns: float, ticks: int) -> None:
    random = Random(2)
    grid = SendGrid(tick_ns, ticks, 10**15)
    late = served(grid, 10**15, lambda: int(random.expovariate(1.0) * tick_ns * ticks), 5_000)
    assert min(b - a for a, b in pairwise(late)) >= 0.8 * tick_ns * ticks


def test_missed_slots_are_counted() -> None:
    grid = SendGrid(10.0, 4, 0)
    due = grid.due_ns
    assert [grid.take(due), grid.take(due + 39 + 40), grid.take(due + 85 + 120)] == [0, 0, 3]


def grid_due_at(due_ns: int) -> SendGrid:
    """Ticks every 10 ns, packets every 40 ns and never closer than 34 ns."""
    return SendGrid(10.0, 4, due_ns - 10)


def test_the_first_packet_is_due_a_tick_after_the_start() -> None:
    grid = SendGrid(10.25, 4, 90)
    assert grid.due_ns == 101, "a part of a nanosecond is waited for"
    assert [grid.is_due(now) for now in (100, 101, 102)] == [False, True, True]


@pytest.mark.parametrize(
    ("now", "expected"),
    [(60, 70), (61, 70), (69, 70), (70, 80), (99, 100), (100, 110), (137, 140), (140, 150)],
)
def test_the_next_tick_is_the_next_instant_of_the_grid(now: int, expected: int) -> None:
    assert grid_due_at(100).next_tick(now) == expected


@pytest.mark.parametrize(
    ("early", "expected"), [(2_000, 0), (1_001, 0), (999, 1_000_000), (0, 1_000_000)]
)
def test_who_wakes_up_a_thousandth_of_a_tick_early_is_on_the_grid(
    early: int, expected: int
) -> None:
    grid = SendGrid(1e6, 1, 1_000_000)
    assert grid.next_tick(2_000_000 - early) == 2_000_000 + expected


@pytest.mark.parametrize(
    ("now", "expected"), [(85, 90), (90, 100), (99, 100), (100, 100), (101, 101), (125, 125)]
)
def test_a_packet_that_is_overdue_is_served_at_once_else_the_grid_is_kept(
    now: int, expected: int
) -> None:
    assert grid_due_at(100).first_tick(now) == expected


@pytest.mark.parametrize(
    ("due", "sent", "now", "expected"),
    [
        (1100, 1050, 1080, 1100),
        (1100, 1066, 1080, 1100),
        (1100, 1067, 1080, 1101),
        (1100, 1090, 1095, 1124),
        # whatever was left behind: a period from now at the latest
        (1140, 1050, 1100, 1140),
        (1141, 1050, 1100, 1140),
        (10**9, 1050, 1100, 1140),
        (1100, 10**9, 1100, 1140),
        # long ago: overdue, and served at once
        (500, 400, 1100, 500),
    ],
)
def test_another_guard_goes_on_in_the_rhythm_that_was_left(
    due: int, sent: int, now: int, expected: int
) -> None:
    grid = grid_due_at(10)
    grid.resume(due, sent, now)
    assert grid.due_ns == expected


@pytest.mark.parametrize(
    ("now", "expected"),
    [(100, 140), (106, 140), (107, 141), (139, 173), (140, 180), (146, 180), (147, 181)],
)
def test_a_late_packet_moves_the_grid_as_far_as_its_successor_must_keep_away(
    now: int, expected: int
) -> None:
    grid = grid_due_at(100)
    assert grid.expected_due(now) == expected
    grid.take(now)
    grid.keep_apart(now)
    assert grid.due_ns == expected


@given(
    tick=st.floats(1e5, 1e7),
    ticks=st.integers(1, 8),
    lateness=st.lists(st.floats(0.0, 5.0), min_size=1, max_size=20),
)
def test_what_is_expected_of_the_next_packet_is_what_becomes_of_it(
    tick: float, ticks: int, lateness: list[float]
) -> None:
    grid = SendGrid(tick, ticks, 10**15)
    for late in lateness:
        now = grid.due_ns + int(late * tick * ticks)
        expected = grid.expected_due(now)
        grid.take(now)
        grid.keep_apart(now)
        assert grid.due_ns == expected
        assert grid.due_ns - now >= 0.85 * tick * ticks - 1.0


def test_a_packet_that_is_sent_before_its_slot_misses_none() -> None:
    grid = grid_due_at(100)
    assert grid.take(50) == 0
    assert grid.due_ns == 140


@pytest.mark.parametrize(("late", "missed"), [(0, 0), (39, 0), (40, 1), (79, 1), (80, 2)])
def test_slots_that_passed_unused_are_counted_and_not_made_up_for(late: int, missed: int) -> None:
    grid = grid_due_at(100)
    assert grid.take(100 + late) == missed
    assert grid.due_ns == 140 + 40 * missed
