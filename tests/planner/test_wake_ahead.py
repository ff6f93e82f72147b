"""How long before its slot the planner wakes: it follows what plans take, down as well as up."""

from motionserver.planner.wake_ahead import (
    LEAST,
    MARGIN_NS,
    SHORTEST_NS,
    STEP_NS,
    WINDOW,
    WakeAhead,
)

MS = 1_000_000
PERIOD = 16_666_667


def after(ahead: WakeAhead, took_ms: float, plans: int) -> int:
    for _ in range(plans):
        ahead.took(round(took_ms * MS))
    return ahead.ahead_ns


def test_nothing_measured_the_guess_holds() -> None:
    ahead = WakeAhead(10 * MS, PERIOD, 0)
    assert after(ahead, 3.0, LEAST - 1) == 10 * MS
    assert after(ahead, 3.0, 1) < 10 * MS


def test_it_follows_down_and_up_in_small_steps() -> None:
    ahead = WakeAhead(10 * MS, PERIOD, 0)
    for took in (3.0, 13.0, 5.0):
        before = ahead.ahead_ns
        for _ in range(2 * WINDOW):
            now = after(ahead, took, 1)
            assert abs(now - before) <= STEP_NS
            before = now
        assert ahead.ahead_ns == round(took * MS) + MARGIN_NS


def test_what_takes_longer_than_there_is_time_does_not_push_it_beyond_its_bound() -> None:
    ahead = WakeAhead(10 * MS, PERIOD, 0)
    assert PERIOD < after(ahead, 500.0, 2 * WINDOW) <= 2 * PERIOD


def test_a_very_short_plan_is_still_begun_a_little_before() -> None:
    assert after(WakeAhead(10 * MS, PERIOD, 0), 0.1, 2 * WINDOW) == SHORTEST_NS


def test_the_guards_check_is_allowed_for() -> None:
    check = 6 * MS
    assert after(WakeAhead(10 * MS, PERIOD, check), 3.0, 2 * WINDOW) == 3 * MS + MARGIN_NS + check


def test_a_single_stall_changes_nothing() -> None:
    ahead = WakeAhead(10 * MS, PERIOD, 0)
    usual = after(ahead, 4.0, 2 * WINDOW)
    assert after(ahead, 60.0, 1) == usual
