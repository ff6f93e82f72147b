"""A sender's stamp against time: what is judged, from when on, and what is said of it."""

from collections.abc import Iterable

import pytest

from motionserver.core.intake.stamp_rate import StampRate

MS = 1_000_000
SECOND = 1000 * MS
REMEDY = (
    " It must be the sender's monotonic clock in nanoseconds. It is ignored, packets are used as "
    "they arrive: delayed ones cannot be told from others."
)


def complaints(stamps: Iterable[int], interval: int = 100 * MS) -> list[str]:
    """What is said after each packet; they arrive evenly, ten to a window unless told."""
    rate, found = StampRate(), []
    for k, stamp in enumerate(stamps):
        rate.heard(7 * SECOND + k * interval, stamp)
        found.append(rate.complaint)
    return found


def running(*rates: float, begin: int = 10**15, count: int = 10) -> list[int]:
    """Stamps of a clock that runs at each rate for a window of ten packets."""
    stamps = [begin]
    for rate in rates:
        first = stamps[-1]
        stamps += [first + round(rate * k * 100 * MS) for k in range(1, count + 1)]
    return stamps


def said(*rates: float) -> str:
    return complaints(running(*rates))[-1]


def test_two_windows_of_a_second_decide() -> None:
    found = complaints(running(0.5, 0.5))
    assert found[:-1] == [""] * 20
    assert found[-1] == "the sender time runs at 0.5 times the rate of time." + REMEDY


@pytest.mark.parametrize(
    ("rate", "is_good"),
    [(1.0, True), (0.81, True), (1.19, True), (0.79, False), (1.21, False), (-1.0, False)],
)
def test_a_fifth_is_borne_which_arrivals_may_jitter(rate: float, is_good: bool) -> None:
    assert (said(rate, rate) == "") is is_good


def test_one_window_proves_nothing_either_way() -> None:
    assert said(0.5, 1.0) == said(1.0, 0.5) == said(0.5, 1.0, 0.5) == ""
    assert said(0.5, 0.5, 1.0) != ""
    assert said(0.5, 0.5, 1.0, 0.5) != ""
    assert said(0.5, 0.5, 1.0, 1.0) == ""


def test_a_pause_and_the_burst_after_it_balance_one_another() -> None:
    assert said(0.5, 1.5) == said(1.5, 0.5) == ""
    assert said(0.5, 1.8) == "", "1.15 in the mean"
    assert said(0.5, 1.95) != "", "1.225 in the mean"
    assert said(0.5, 0.5, 1.5) == "", "and take back what was said"


def going_back(*times: int) -> list[int]:
    """Stamps that go back by a nanosecond so often in each window, at the right rate."""
    stamps = [10**15]
    for often in times:
        first = stamps[-1]
        for k in range(1, 11):
            stamps.append(stamps[-1] - 1 if k <= often else first + k * 100 * MS)
    return stamps


def test_three_steps_backwards_in_a_second_are_no_clock() -> None:
    assert complaints(going_back(2, 2))[-1] == ""
    assert complaints(going_back(3, 2))[-1] == complaints(going_back(2, 3))[-1] == ""
    assert complaints(going_back(3, 4))[-1] == (
        "the sender time went backwards 4 times in a second." + REMEDY
    )
    assert "backwards 3 times" in complaints(going_back(3, 3))[-1]


def test_steps_backwards_are_counted_over_both_windows_that_balance() -> None:
    slow, fast = running(0.5, 1.5), running(0.5, 1.5)
    for k in (5, 15):
        slow[k] = slow[k - 1] - 1
    assert complaints(slow)[-1] == ""
    for k in (5, 14, 16):
        fast[k] = fast[k - 1] - 1
    assert complaints(fast)[-1] != ""


def test_a_stamp_that_stands_is_told_with_its_value() -> None:
    assert complaints([77] * 21)[-1] == (
        "the sender time does not advance, it is 77 in every packet." + REMEDY
    )


def test_what_is_told_is_what_the_newer_window_is() -> None:
    assert "runs at 0.5 times" in said(0.1, 0.5)
    assert "runs at 1e-06 times" in said(0.0, 1e-6)


@pytest.mark.parametrize("begin", [0, 1 << 63])
def test_where_a_clock_begins_says_nothing(begin: int) -> None:
    assert complaints(running(1.0, 1.0, 1.0, begin=begin))[-1] == ""
    assert "0.5 times" in complaints(running(0.5, 0.5, begin=begin))[-1]


@pytest.mark.parametrize(
    ("rate", "unit"),
    [
        (1e-3, "microseconds"),
        (1e-6, "milliseconds"),
        (1e-9, "seconds"),
        (1e3, "picoseconds"),
        (0.51e3, "picoseconds"),
        (1.99e3, "picoseconds"),
        (0.51e-3, "microseconds"),
        (1.99e-3, "microseconds"),
    ],
)
def test_a_unit_within_a_factor_of_two_is_guessed(rate: float, unit: str) -> None:
    assert said(rate, rate) == (
        f"the sender time runs at {rate:.3g} times the rate of time: is it in {unit}?{REMEDY}"
    )


@pytest.mark.parametrize("rate", [0.5e3, 2e3, 30.0, 1e6, 1e-2, 0.5])
def test_at_other_rates_nothing_is_guessed(rate: float) -> None:
    assert f"{rate:.3g} times the rate of time. It must" in said(rate, rate)


def test_four_packets_are_needed() -> None:
    """Every 300 ms: the fourth ends a window of 1.2 s. Every 400 ms: of 1.6 s."""
    assert complaints([5] * 8, 300 * MS)[-1] == complaints([5] * 8, 400 * MS)[-1] == ""
    assert complaints([5] * 9, 300 * MS)[-1] != ""
    assert complaints([5] * 9, 400 * MS)[-1] != ""


def test_a_second_is_needed() -> None:
    assert complaints([5] * 20, 100 * MS)[-1] == ""
    assert complaints([5] * 21, 100 * MS - 1)[-1] == ""
    assert complaints([5] * 21, 100 * MS)[-1] != ""


def test_two_seconds_of_silence_belong_to_no_window() -> None:
    assert complaints([5] * 9, 2 * SECOND)[-1] != ""
    assert complaints([5] * 30, 2 * SECOND + 1)[-1] == ""


def test_after_a_silence_two_windows_are_waited_for_anew() -> None:
    rate, at = StampRate(), 0

    def hear(count: int, gap: int) -> str:
        nonlocal at
        at += gap
        for _ in range(count):
            rate.heard(at, 5)
            at += 100 * MS
        at -= 100 * MS
        return rate.complaint

    assert hear(20, 0) == ""
    # what was heard of the second window goes with the first
    assert hear(20, 2 * SECOND + 1 + 900 * MS) == ""
    assert hear(1, 100 * MS) != ""


def test_a_window_that_begins_with_a_silence_begins_after_it() -> None:
    """Two seconds and a nanosecond after its first packet; the next two seconds decide."""
    rate, found = StampRate(), []
    for at in (0, *(2 * SECOND + 1 + k * 100 * MS for k in range(21))):
        rate.heard(at, 5)
        found.append(rate.complaint)
    assert found[:-1] == [""] * 21
    assert found[-1] != ""


def test_a_stamp_that_repeats_is_no_step_backwards() -> None:
    stamps = running(1.0, 1.0)
    for first in (0, 10):
        stamps[first + 1] = stamps[first]
        for k in (4, 7):
            stamps[first + k] = stamps[first + k - 1] - 1
    assert complaints(stamps)[-1] == ""
