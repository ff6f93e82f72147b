"""The planner's wake-ups: once a period on the grid of the send slots, whatever the slot is."""

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from motionserver.planner.wake import LEAST_PAUSE_NS, next_wake

MS = 1_000_000


def drive(rate_hz: float, per_plan: int, budget: int, took: int, periods: int = 50) -> list[int]:
    """Wake-ups of a planner that thinks for ``took`` [ns], heard from the guard's clock."""
    slot = int(1e9 / rate_hz)
    period = per_plan * slot
    due, wakes = 5 * period, []
    for _ in range(periods):
        # what the guard says when the planner wakes: the next slot
        first = (due // slot + 1) * slot - budget
        due = next_wake(first, slot, due + period, period, due + took)
        wakes.append(due)
    return wakes


def test_every_rate_keeps_its_period() -> None:
    for rate_hz, per_plan in ((60.0, 1), (100.0, 1), (240.0, 2), (480.0, 5), (1000.0, 10)):
        slot = int(1e9 / rate_hz)
        wakes = drive(rate_hz, per_plan, 8 * MS, 3 * MS)
        gaps = {b - a for a, b in pairwise(wakes[1:])}
        assert gaps == {per_plan * slot}, rate_hz


def test_it_wakes_one_budget_before_a_slot() -> None:
    for budget in (3 * MS, 8 * MS, 10 * MS):
        assert all((wake + budget) % MS == 0 for wake in drive(1000.0, 10, budget, 4 * MS))


def test_who_is_behind_skips_whole_periods() -> None:
    wakes = drive(1000.0, 10, 8 * MS, 12 * MS)
    assert {b - a for a, b in pairwise(wakes[1:])} == {20 * MS}


@given(
    st.integers(0, 10**12),
    st.integers(1, 30),
    st.integers(1, 16),
    st.integers(-(10**9), 10**9),
    st.integers(-(10**9), 10**9),
)
def test_it_never_wakes_at_once_and_always_on_the_grid(
    first: int, slot_ms: int, per_plan: int, ahead: int, lag: int
) -> None:
    slot = slot_ms * MS
    due, now = first + ahead, first + lag
    wake = next_wake(first, slot, due, per_plan * slot, now)
    assert (wake - first) % slot == 0
    assert wake >= now + LEAST_PAUSE_NS
    # near what is due, unless that has passed
    assert wake >= due - slot // 2
    assert wake <= max(due + slot, now + LEAST_PAUSE_NS + per_plan * slot)
