"""Order, losses and jumps: a number far away is confirmed by what follows, or changes nothing."""

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motions import motion

from motionserver.core.intake.gate import Gate
from motionserver.core.intake.sequence_order import FEW, MOST_MISSING, SequenceOrder

A = ("native", "10.0.0.1:5")
WORLD = 1 << 32


def judged(*sequences, is_older=None, start=None):
    order = SequenceOrder()
    if start is not None:
        order.judge(start, 1.0, None)
    return order, [order.judge(one % WORLD, 1.0, is_older) for one in sequences]


@pytest.mark.parametrize("begin", [100, WORLD - 2, 0])
@pytest.mark.parametrize(
    "jump", [1 << 30, 1 << 31, (1 << 31) - 1, 10_000, 1000, 100, -1000, -(1 << 30)]
)
def test_one_number_far_away_is_refused_and_the_stream_goes_on(begin, jump):
    order, verdicts = judged(begin + jump, begin + 1, begin + 2, begin + 3, start=begin)
    assert verdicts[0] in ("jumped", "reordered")
    assert verdicts[1:] == [None] * 3
    assert order.lost == 0


@pytest.mark.parametrize("jump", [1 << 30, 10_000, -10_000, -100])
def test_a_count_that_goes_on_from_a_jump_is_followed(jump):
    begin = 200_000
    order, verdicts = judged(*(begin + jump + k for k in range(6)), start=begin)
    assert verdicts[: FEW - 1] == ["jumped" if jump > 0 else "reordered"] * (FEW - 1)
    assert verdicts[FEW - 1 :] == [None] * (6 - FEW + 1)
    assert order.lost == 0


def test_a_jump_between_two_packets_of_the_stream_never_adds_up():
    order = SequenceOrder()
    order.judge(0, 1.0, None)
    for k in range(1, 50):
        assert order.judge(1_000_000 + k, 1.0, None) == "jumped"
        assert order.judge(k, 1.0, None) is None


def test_repeats_of_one_jumped_packet_prove_nothing():
    _, verdicts = judged(*[5_000_000] * 10, 1, start=0)
    assert verdicts == ["jumped"] * 10 + [None]


def test_a_sender_that_begins_anew_is_a_restart():
    order, verdicts = judged(0, 1, 2, start=5000)
    assert verdicts == ["reordered", "reordered", None]
    assert order.is_restart
    order.judge(3, 1.0, None)
    assert not order.is_restart


def test_what_its_stamp_shows_to_be_late_never_becomes_the_stream():
    _, verdicts = judged(*range(60, 90), is_older=True, start=100)
    assert set(verdicts) == {"reordered"}


def test_repeats_of_the_newest_packets_are_late_ones_without_a_stamp():
    """A way that delivers each ten packets twice."""
    order = SequenceOrder()
    for ten in range(20):
        for k in range(10):
            assert order.judge(10 * ten + k, 1.0, None) is None
        for k in range(10):
            assert order.judge(10 * ten + k, 1.0, None) in ("reordered", "replayed")


def test_a_late_packet_was_not_lost():
    order, verdicts = judged(1, 2, 5, 3, 6, 4, 3, start=0)
    assert verdicts == [None, None, None, "reordered", None, "reordered", "reordered"]
    assert order.lost == 0


def test_a_loss_that_time_explains_is_no_jump_and_is_counted():
    order = SequenceOrder()
    order.judge(0, 0.0, None)
    assert order.judge(160, 3.0 * 160, None) is None
    assert order.lost == 159
    assert order.judge(161 + 40_000, 3.0 * 160, None) == "jumped"


def test_what_is_missing_is_remembered_in_bounds():
    order = SequenceOrder()
    order.judge(0, 0.0, None)
    assert order.judge(100_000, 200_000.0, None) is None
    assert order.lost == 99_999
    assert order.judge(99_999, 1.0, None) == "reordered"
    assert order.judge(100_000 - MOST_MISSING, 1.0, None) == "reordered"
    assert order.lost == 99_997
    order.judge(100_000 - MOST_MISSING - 1, 1.0, True)
    assert order.lost == 99_997


@settings(max_examples=30, deadline=None)
@given(
    loss=st.floats(0.0, 0.3),
    shuffle=st.integers(0, 6),
    begin=st.sampled_from([0, 1000, WORLD - 300]),
    seed=st.integers(0, 10**6),
)
def test_lost_are_exactly_the_numbers_that_never_came(loss, shuffle, begin, seed):
    noise = random.Random(seed)
    sent = [k for k in range(600) if k in (0, 599) or noise.random() >= loss]
    arrived = sorted(sent, key=lambda k: (k in (0,) and -1) or k + noise.uniform(0, shuffle))
    arrived = [0, *[k for k in arrived if k not in (0, 599)], 599]
    order = SequenceOrder()
    for k in arrived:
        order.judge((begin + k) % WORLD, 3.0, None)
    assert order.lost == 600 - len(sent)


def test_before_a_packet_nothing_began_anew():
    assert not SequenceOrder().is_restart
    assert not Gate().is_restart


@pytest.mark.parametrize(("last", "verdict"), [(968, "reordered"), (967, None)])
def test_without_a_stamp_the_last_32_numbers_are_late_ones(last, verdict):
    order, verdicts = judged(last - 2, last - 1, last, start=1000)
    assert verdicts == ["reordered", "reordered", verdict]
    assert order.is_restart is (verdict is None)


def test_the_newest_1024_missing_numbers_are_waited_for():
    order = SequenceOrder()
    order.judge(0, 0.0, None)
    order.judge(2000, 2000.0, None)
    assert order.lost == 1999
    order.judge(2000 - 1024, 1.0, True)
    assert order.lost == 1998
    order.judge(2000 - 1025, 1.0, True)
    assert order.lost == 1998
    order.judge(2002, 1.0, None)
    order.judge(2000 - 1023, 1.0, True)
    assert order.lost == 1998, "one more is missing, for which the oldest two are not waited for"


@pytest.mark.parametrize("repeated", [9, 10])
def test_a_number_that_came_was_not_lost_and_comes_twice(repeated):
    order, _ = judged(9, 10, 12, start=8)
    assert order.lost == 1
    assert order.judge(repeated, 1.0, None) == "reordered"
    assert order.lost == 1
    assert order.judge(11, 1.0, None) == "reordered"
    assert order.lost == 0


def test_a_count_far_ahead_is_followed_though_its_clock_was_set_back():
    _, verdicts = judged(5000, 5001, 5002, is_older=True, start=0)
    assert verdicts == ["jumped", "jumped", None]


@pytest.mark.parametrize(("step", "is_followed"), [(16, True), (17, False)])
def test_what_goes_on_from_a_jump_may_lose_as_much_as_any_stream(step, is_followed):
    _, verdicts = judged(5000, 5000 + step, 5000 + 2 * step, start=0)
    assert (verdicts[-1] is None) is is_followed


def test_what_was_missing_before_a_count_began_anew_stays_lost():
    order, _ = judged(1, 3, start=0)
    for k in range(3):
        order.judge(1_000_000 + k, 1.0, None)
    assert order.lost == 1
    assert order.judge(2, 1.0, True) == "reordered"
    assert order.lost == 1


def stream(gate, begin_ms, count, first, session=1, stamps=True):
    found = []
    for k in range(count):
        at = begin_ms + 10.0 * k
        sent = at - 3.0 if stamps else None
        found.append(gate.refuse(*A, motion(at, first + k, sent_ms=sent, session=session)))
    return found


@pytest.mark.parametrize("stamps", [True, False])
def test_a_gate_is_not_blinded_by_one_number_far_ahead(stamps):
    gate = Gate()
    stream(gate, 0.0, 100, 0, stamps=stamps)
    at = 1005.0
    assert gate.refuse(*A, motion(at, 100 + (1 << 30), sent_ms=at - 3.0 if stamps else None))
    assert stream(gate, 1010.0, 100, 100, stamps=stamps) == [None] * 100
    assert gate.lost == 0


@pytest.mark.parametrize("ahead", [17, 15, 16, 100])
def test_a_gate_that_took_a_small_jump_returns_to_the_stream(ahead):
    gate = Gate()
    stream(gate, 0.0, 100, 0)
    gate.refuse(*A, motion(1005.0, 100 + ahead, sent_ms=1002.0))
    found = stream(gate, 1010.0, 100, 100)
    assert found.count(None) >= 97
    assert None in found[:3]


@pytest.mark.parametrize("pause", [20.0, 500.0, 2500.0, 10_000.0])
@pytest.mark.parametrize("stamps", [True, False])
def test_a_client_that_restarts_with_its_session_is_heard_again(pause, stamps):
    """An hour's count is not waited for."""
    gate = Gate()
    stream(gate, 0.0, 100, 360_000, stamps=stamps)
    found = stream(gate, 1000.0 + pause, 50, 0, stamps=stamps)
    refused = 0 if pause > 2000.0 else FEW - 1
    assert found == ["reordered"] * refused + [None] * (50 - refused)
    assert gate.lost == 0


def test_packets_refused_as_old_or_out_of_range_are_not_lost():
    gate = Gate()
    stream(gate, 0.0, 100, 0)
    burst = [gate.refuse(*A, motion(1300.0, 100 + k, sent_ms=997.0 + 10.0 * k)) for k in range(30)]
    assert burst.count("old") >= 20
    assert gate.refuse(*A, motion(1310.0, 130, sent_ms=1307.0, x=200.0)) == "out-of-range"
    assert gate.refuse(*A, motion(1320.0, 131, sent_ms=1317.0)) is None
    assert gate.lost == 0


def test_a_client_that_restarts_is_heard_though_its_clock_stood_still():
    """Half a second passed here, a hundredth in its clock: of another run that tells nothing."""
    gate = Gate()
    stream(gate, 0.0, 100, 360_000)
    found = []
    for k in range(6):
        found.append(gate.refuse(*A, motion(1500.0 + 10.0 * k, k, sent_ms=997.0 + 10.0 * k)))
        assert gate.is_restart is (k == 2)
    assert found == ["reordered", "reordered", None, None, None, None]
