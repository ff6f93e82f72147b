"""The grid of ticks and packets: even when served in time, never two packets close together."""

from collections.abc import Callable
from itertools import pairwise
from random import Random

import pytest

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
