"""How long the next plan will take, from those before it."""

from motionserver.planner.show import GUESS_NS, Timing
from motionserver.planner.spare_time import KEPT

MS = 1_000_000


def test_nothing_measured_is_guessed():
    assert Timing(10 * MS).expected_ns == GUESS_NS


def test_five_stalls_in_a_hundred_are_not_expected_six_are_and_old_times_are_forgotten():
    timing = Timing(10 * MS)
    for took in [8] * KEPT + [2] * (KEPT - 5) + [9] * 5:
        timing.thought(took * MS)
    assert timing.expected_ns == 2 * MS
    timing.thought(9 * MS)
    assert timing.expected_ns == 9 * MS
    assert timing.summary()["last_ms"] == 9.0
