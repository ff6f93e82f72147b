"""When a packet is late, to the nanosecond, by figures worked by hand.

Packets usually come every 10 ms and 50 ms of delay are borne. The least delay may rise by a
hundredth of the time that passes: by 0.1 ms from packet to packet.
"""

import pytest

from motionserver.core.intake.sender_clock import SenderClock

MS = 1_000_000


def late(*packets: tuple[float, float], limit: float = 50, ns: int = 0) -> list[bool]:
    """Verdicts on packets of (arrival, stamp) [ms]; the last two stamps are ``ns`` earlier."""
    clock = SenderClock()
    found = []
    for k, (arrival, stamp) in enumerate(packets):
        sent = round(stamp * MS) - (ns if k >= len(packets) - 2 else 0)
        found.append(clock.is_late(round(arrival * MS), sent, 10 * MS, round(limit * MS)))
    return found


def creeping() -> list[tuple[float, float]]:
    """Each packet 5 ms later than the one before: 43.65 ms late at last, with 135 ms on our clock.

    No pause explains that: packets are no more than 15 ms apart.
    """
    return [(15.0 * k, 10.0 * k) for k in range(10)]


@pytest.mark.parametrize(
    ("gap", "is_pause"), [(20.0, False), (20.000001, True), (25.0, True), (30.0, True)]
)
def test_arrivals_pause_for_more_than_two_intervals(gap: float, is_pause: bool) -> None:
    """Late by 58 ms: behind a pause that may be, without one the clock is another one."""
    at = 135.0 + gap
    assert late(*creeping(), (at, at - 60.0))[-1] is is_pause


@pytest.mark.parametrize(("ns", "then"), [(0, [True, True]), (1, [True, False])])
def test_a_pause_explains_so_much_and_an_interval_and_half_the_limit(ns, then) -> None:
    """43.65 + 25 ms of a queue, 10 ms, 25 ms, and 1.6 ms that the least delay has risen.

    What is later than that is doubted, and with the next packet it is another clock.
    """
    offset = 43.65 + 25.0 + 10.0 + 25.0 + 1.6
    packets = [(160.0, 160.0 - offset), (170.0, 170.0 - offset - 0.1)]
    assert late(*creeping(), *packets, ns=ns)[-2:] == then


@pytest.mark.parametrize(("ns", "then"), [(0, [True, True]), (1, [True, False])])
def test_without_a_pause_an_interval_and_half_the_limit_are_explained(ns, then) -> None:
    """Of a limit of 10 ms: 10 + 5 ms."""
    assert late((0, 0), (10, 10 - 15.1), (20, 20 - 15.2), limit=10, ns=ns)[-2:] == then


def test_what_rises_by_more_than_the_limit_at_once_may_be_a_slip_of_one_stamp() -> None:
    """From 43.65 to 93.65 ms it creeps on and is learnt, one nanosecond more is doubted."""
    stamp = 150.0 - 93.65 - 1.5
    assert late(*creeping(), (150.0, stamp))[-1] is False
    assert late(*creeping(), (150.0, stamp - 1e-6))[-1] is True


@pytest.mark.parametrize("before", [1, 2, 5])
def test_every_single_slip_is_refused(before: int) -> None:
    """The first packet may be followed by one, and packets that are in time clear the doubt."""
    packets = [(10.0 * k, 10.0 * k) for k in range(before)]
    packets += [(10.0 * k, 10.0 * k - (200.0 if k in (before, before + 2) else 0.0))
                for k in range(before, before + 4)]  # fmt: skip
    assert late(*packets)[before:] == [True, False, True, False]


def in_time() -> list[tuple[float, float]]:
    return [(10.0 * k, 10.0 * k) for k in range(11)]


def after_a_pause(spacing: float, count: int = 6, ns: float = 0.0) -> list[bool]:
    """The way stands for 400 ms, and then packets sent every 10 ms come at another spacing."""
    queue = [(510.0 + spacing * k, 110.0 + 10.0 * k) for k in range(count)]
    queue[3] = (queue[3][0] + ns / MS, queue[3][1])
    return late(*in_time(), *queue)[11:]


def test_four_late_packets_at_their_spacing_prove_a_longer_way() -> None:
    assert after_a_pause(10.0) == [True, True, True, False, False, False]


def test_a_queue_that_empties_arrives_in_less_than_three_quarters_of_its_time() -> None:
    assert after_a_pause(7.5)[:4] == [True, True, True, False]
    assert after_a_pause(7.5, ns=-1.0)[:4] == [True, True, True, True]
    assert after_a_pause(0.0) == [True] * 6


def test_packets_at_one_instant_prove_nothing_whatever_their_stamps() -> None:
    same = [(510.0, 110.0)] * 6
    assert late(*in_time(), *same)[11:] == [True] * 6
    assert late(*in_time(), *same[:3], (510.000001, 110.0))[11:] == [True, True, True, False]


@pytest.mark.parametrize(
    ("gap", "then"),
    [(50.0, [False]), (50.000001, [True, True, True, False]), (60.0, [True, True, True, False])],
)
def test_a_further_pause_that_is_longer_than_the_limit_begins_the_proof_anew(gap, then) -> None:
    queue = [(510.0 + 10.0 * k, 110.0 + 10.0 * k) for k in range(3)]
    queue += [(530.0 + gap + 10.0 * k, 130.0 + gap + 10.0 * k) for k in range(len(then))]
    assert late(*in_time(), *queue)[11:] == [True, True, True, *then]


def test_a_short_pause_behind_which_it_is_late_begins_a_proof() -> None:
    """25 ms after packets that were 43.65 ms late."""
    queue = [(160.0 + 10.0 * k, 100.0 + 10.0 * k) for k in range(5)]
    assert late(*creeping(), *queue)[10:] == [True, True, True, False, False]


def test_a_short_pause_after_a_packet_exactly_at_the_limit_begins_a_proof() -> None:
    queue = [(35.0 + 10.0 * k, -25.0 + 10.0 * k) for k in range(5)]
    assert late((0, 0), (10, 10 - 50.1), *queue)[1:] == [False, True, True, True, False, False]


def test_a_pause_whose_queue_is_empty_explains_nothing_any_more() -> None:
    """Then the clock is set back by 200 ms: one packet is refused, the next is not."""
    packets = [(0, 0), (410, 10), *((420 + 10 * k, 420 + 10 * k) for k in range(3))]
    assert late(*packets, (450, 250), (460, 260))[1:] == [True, False, False, False, True, False]


def test_the_least_delay_rises_by_whole_nanoseconds_however_often() -> None:
    """By 500,000 ns, 99 times by 100,000 ns and by 600,000 ns: to 11 ms in all."""
    for ns, verdict in ((0, False), (1, True)):
        clock = SenderClock()
        step = 10_000_099
        clock.is_late(0, 0, 10 * MS, 50 * MS)
        for k in range(1, 101):
            assert not clock.is_late(40 * MS + k * step, k * step, 10 * MS, 50 * MS)
        arrival = 40 * MS + 100 * step + 60 * MS
        assert clock.is_late(arrival, arrival - 61 * MS - ns, 10 * MS, 50 * MS) is verdict
