"""The numbers of the gate, each exactly at its edge, and what a new owner does not inherit."""

from dataclasses import replace

import numpy as np
import pytest
from motions import MS, motion, preview

from motionserver.core.intake.gate import Gate
from motionserver.core.state import DriveMode

A = ("native", "10.0.0.1:5")
B = ("native", "10.0.0.2:5")
TEN_G = 10.0 * 9.81
FASTEST_TURN = float(np.radians(4000.0))


def verdict(packet):
    return Gate().refuse(*A, packet)


@pytest.mark.parametrize(
    ("most", "told"),
    [
        (TEN_G, lambda v: motion(force=(0.0, -v, 0.0))),
        (TEN_G, lambda v: motion(preview=preview([0.1], x=v))),
        (FASTEST_TURN, lambda v: motion(rates=(0.0, 0.0, -v))),
        (FASTEST_TURN, lambda v: motion(preview=preview([0.1], rate=v))),
        (1000.0, lambda v: motion(speed=-v)),
        (60.0, lambda v: motion(preview=preview([0.1, v]))),
    ],
    ids=["force", "force ahead", "rates", "rates ahead", "speed", "farthest"],
)
def test_the_edge_itself_is_believed_and_what_lies_beyond_is_not(most, told):
    assert verdict(told(most)) is None
    assert verdict(told(np.nextafter(most, np.inf))) == "out-of-range"


def test_before_the_first_packet_nothing_is_fresh_and_nothing_believed():
    gate = Gate()
    assert gate.mode is DriveMode.DRIVE
    assert not gate.is_fresh(0)
    assert gate.believed_ns(0, is_cued=True) == 0
    assert gate.believed_ns(0, is_cued=False) == 0


def test_an_owner_that_falls_silent_is_not_fresh_for_longer_than_its_patience():
    gate = Gate()
    gate.refuse(*A, motion(0.0, 1))
    assert gate.is_fresh(300 * MS)
    assert not gate.is_fresh(300 * MS + 1)


def test_good_packets_outweigh_a_few_bad_ones():
    gate = Gate()
    for k in range(200):
        gate.refuse(*A, motion(4.0 * k, k))
        if k % 16 == 0:
            gate.spoilt(*A, 4 * MS * k)
    assert gate.is_fresh(796 * MS)
    assert gate.spoilage.share(796 * MS) == pytest.approx(13 / 213)


def test_an_owner_that_took_leave_leaves_nothing_to_the_next():
    gate = Gate()
    for k in range(20):
        gate.refuse(*A, motion(10.0 * k, k))
        gate.spoilt(*A, 10 * MS * k)
    gate.refuse(*A, motion(200.0, 20, mode=DriveMode.BYE))
    assert gate.refuse(*B, motion(210.0, 500)) is None
    assert gate.freshness.rate_hz() == 0.0, "its own packets only"
    assert gate.lost == 0, "its own sequence"
    assert gate.is_fresh(210 * MS), "its own nonsense"


def aged(slower_ppm, seconds):
    """Verdicts on a sender that speaks every 1.9 s, whose clock runs slower than ours."""
    gate, found = Gate(), set()
    for k in range(int(seconds / 1.9)):
        sent = 1900.0 * k * (1.0 - slower_ppm * 1e-6)
        found.add(gate.refuse(*A, motion(1900.0 * k, k, sent_ms=sent)))
    return found


@pytest.mark.parametrize("ppm", [90.0, 200.0, 2000.0])
def test_a_clock_that_runs_slow_is_followed_for_hours(ppm):
    # unfollowed 90 ppm would seem to lag by 300 ms after 55 minutes
    assert aged(ppm, 7200.0) == {None}


def test_a_delay_exactly_at_the_patience_is_borne():
    """Packets held back by a way that stood still for a second: 300 ms is the patience here."""

    def later(by_ns):
        gate = Gate()
        for sequence, at in ((1, 0.0), (2, 1000.0)):
            assert gate.refuse(*A, motion(at, sequence, sent_ms=at)) is None
        # what may rise by a hundredth of the time that passes has risen by 10 ms
        sent = 2000 * MS - 10 * MS - by_ns
        return gate.refuse(*A, replace(motion(2000.0, 3), sender_ns=sent))

    assert later(300 * MS) is None
    assert later(300 * MS + 1) == "old"


@pytest.mark.parametrize(
    ("roll", "pitch", "is_attitude"),
    [
        (float(np.float32(np.pi)), 0.0, True),
        (-float(np.float32(np.pi)), float(np.float32(np.pi / 2)), True),
        (3.1417, 0.0, False),
        (0.0, -1.5709, False),
        (170.0, 0.0, False),
        (0.0, 5.0, False),
        (np.nan, 0.0, False),
    ],
)
def test_an_attitude_beyond_pi_or_half_of_it_is_none(roll, pitch, is_attitude):
    gate = Gate()
    refusal = gate.refuse(*A, motion(attitude=(roll, pitch)))
    assert refusal == (None if is_attitude else "out-of-range")
    assert ("degrees" in gate.last_refusal) is not is_attitude


@pytest.mark.parametrize(("ahead", "verdict"), [(46, None), (47, "jumped")])
def test_three_times_as_many_packets_may_be_lost_as_usually_come_in_a_gap(ahead, verdict):
    """100 a second, 100 ms: 30, and 16 in any case."""
    gate = Gate()
    for k in range(101):
        gate.refuse(*A, motion(10.0 * k, k))
    assert gate.refuse(*A, motion(1100.0, 100 + ahead)) == verdict


def test_a_silent_owner_that_returns_on_another_port_takes_its_drive_back():
    asked = []

    def is_same(owner, who):
        asked.append((owner.address, who.address))
        return who.address == B[1]

    gate = Gate(lambda: False, is_same_game=is_same)
    gate.refuse(*A, motion(0.0, 1))
    assert gate.refuse(*B, motion(1000.0, 1)) == "second-client"
    assert gate.refuse("native", "10.0.0.3:5", motion(2500.0, 1)) == "second-client"
    assert gate.refuse(*B, motion(2501.0, 1)) is None
    assert asked == [(A[1], "10.0.0.3:5"), (A[1], B[1])]


def test_an_owner_is_silent_before_its_first_packet_and_two_seconds_after_its_last():
    gate = Gate()
    assert gate.is_silent(0) is True
    gate.refuse(*A, motion(0.0, 1))
    assert gate.is_silent(2000 * MS) is False
    assert gate.is_silent(2000 * MS + 1) is True


def test_an_owner_that_sends_too_rarely_is_not_believed():
    gate = Gate()
    for k in range(8):
        gate.refuse(*A, motion(250.0 * k, k))
    assert not gate.is_fresh(1750 * MS)
    assert gate.believed_ns(1750 * MS, is_cued=True) == 0


def test_no_packet_was_refused_before_the_first():
    gate = Gate()
    assert gate.last_refusal == ""
    gate.refuse(*A, motion(0.0, 1, x=200.0))
    assert "beyond 10 g" in gate.last_refusal
