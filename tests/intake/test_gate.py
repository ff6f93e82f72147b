"""What is believed of a packet: owner, order, age, range."""

import math

import numpy as np
import pytest
from motions import motion, preview

from motionserver.core.axes import GRAVITY, frozen
from motionserver.core.intake.gate import Gate, Owner
from motionserver.core.state import DriveMode, Preview, VehicleMotion

A = ("native", "10.0.0.1:5")
B = ("native", "10.0.0.2:5")


def test_the_first_owns_and_a_second_is_refused() -> None:
    gate = Gate()
    assert gate.refuse(*A, motion(0, 1)) is None
    assert gate.owner == Owner(*A, 1)
    for at in (10, 1000, 2000):
        assert gate.refuse(*B, motion(at, 1)) == "second-client"
    assert gate.refuse(*A, motion(2000.0, 2, session=9)) == "second-client"
    assert gate.refuse("beamng", A[1], motion(2000.0, 2)) == "second-client"
    assert gate.refuse(*A, motion(2000.0, 2)) is None


def test_a_silent_owner_is_replaced_only_when_that_is_allowed() -> None:
    allowed = False
    gate = Gate(lambda: allowed)
    gate.refuse(*A, motion(0, 1))
    assert gate.refuse(*B, motion(2001, 7)) == "second-client"
    allowed = True
    assert gate.refuse(*B, motion(2002, 7)) is None
    assert gate.owner == Owner(*B, 1)
    assert gate.refuse(*A, motion(2003, 2)) == "second-client"


def test_after_bye_the_next_may_come_at_once() -> None:
    gate = Gate()
    gate.refuse(*A, motion(0, 1))
    gate.refuse(*A, motion(10, 2, mode=DriveMode.BYE))
    assert gate.mode is DriveMode.BYE
    assert gate.refuse(*B, motion(20, 1)) is None
    assert gate.mode is DriveMode.DRIVE


def test_a_newcomer_that_talks_nonsense_does_not_own() -> None:
    gate = Gate()
    assert gate.refuse(*A, motion(0, 1, x=200.0)) == "out-of-range"
    assert gate.owner is None


@pytest.mark.parametrize(
    ("first", "then", "verdict", "lost"),
    [
        (5, 5, "replayed", 0),
        (5, 4, "reordered", 0),
        (5, 6, None, 0),
        (5, 9, None, 3),
        (0xFFFFFFFF, 0, None, 0),
        (0xFFFFFFFE, 1, None, 2),
        (1, 0xFFFFFFFE, "reordered", 0),
        (5, 21, None, 15),
        (5, 22, "jumped", 0),
        (0, (1 << 31) - 1, "jumped", 0),
        (0, 1 << 31, "reordered", 0),
        (None, 1, None, 0),
        (1, None, None, 0),
    ],
)
def test_order_is_judged_modulo_two_to_the_32(
    first: int | None, then: int | None, verdict: str | None, lost: int
) -> None:
    gate = Gate()
    assert gate.refuse(*A, motion(0, first)) is None
    assert gate.refuse(*A, motion(10, then)) == verdict
    assert gate.lost == lost


def test_a_refused_packet_changes_nothing() -> None:
    gate = Gate()
    gate.refuse(*A, motion(0, 5))
    gate.refuse(*A, motion(10, 4, mode=DriveMode.PAUSE))
    assert gate.mode is DriveMode.DRIVE
    assert gate.freshness.newest_ns == 0
    assert gate.refuse(*A, motion(20, 6)) is None


def steady(gate: Gate, count: int = 20, delay: float = 5.0) -> float:
    for k in range(count):
        assert gate.refuse(*A, motion(10.0 * k + delay, k, sent_ms=10.0 * k)) is None
    return 10.0 * (count - 1) + delay


def test_a_burst_after_a_stall_is_old_but_for_its_newest() -> None:
    gate = Gate()
    now = steady(gate) + 300.0
    verdicts = [gate.refuse(*A, motion(now, k, sent_ms=10.0 * k)) for k in range(20, 20 + 30)]
    # the stall ends at 495 ms; the quickest delay is 5 ms; older than 50 ms is old
    assert verdicts == ["old"] * 25 + [None] * 5 or verdicts == ["old"] * 24 + [None] * 6


def test_without_a_senders_clock_nothing_is_old() -> None:
    gate = Gate()
    for k in range(5):
        assert gate.refuse(*A, motion(500.0 * k, k)) is None


def test_a_slow_senders_clock_is_followed() -> None:
    gate = Gate()
    for k in range(6000):
        sent = 10.0 * k * (1.0 - 50e-6)
        assert gate.refuse(*A, motion(10.0 * k, k, sent_ms=sent)) is None, k


def test_a_way_that_became_longer_is_learnt_after_a_silence() -> None:
    gate = Gate()
    now = steady(gate)
    # the client's computer slept: its clock stood still for a minute
    sent = 200.0
    assert gate.refuse(*A, motion(now + 60_000.0, 20, sent_ms=sent)) is None
    assert gate.refuse(*A, motion(now + 60_010.0, 21, sent_ms=sent + 10.0)) is None
    assert gate.refuse(*A, motion(now + 60_600.0, 22, sent_ms=sent + 20.0)) == "old"


def test_the_delay_of_a_former_owner_says_nothing_of_the_next() -> None:
    gate = Gate()
    now = steady(gate)
    assert gate.refuse(*B, motion(now + 3000.0, 1, sent_ms=-5000.0)) is None
    assert gate.refuse(*B, motion(now + 3010.0, 2, sent_ms=-4990.0)) is None


@pytest.mark.parametrize(
    "wrong",
    [
        motion(force=(98.2, 0.0, GRAVITY)),
        motion(force=(0.0, -98.2, GRAVITY)),
        motion(force=(0.0, 0.0, math.nan)),
        motion(force=(math.inf, 0.0, 0.0)),
        motion(rates=(0.0, 70.0, 0.0)),
        motion(rates=(math.nan, 0.0, 0.0)),
        motion(speed=math.nan),
        motion(speed=1e30),
        motion(preview=preview([0.1, 0.2], x=100.0)),
        motion(preview=preview([0.1, 0.2], rate=71.0)),
        motion(preview=preview([0.1, 0.1])),
        motion(preview=preview([-0.1, 0.1])),
        motion(preview=preview([0.2, 0.1])),
        motion(preview=preview([0.1, 61.0])),
        motion(preview=preview([0.1, math.inf])),
        motion(preview=preview([math.nan])),
    ],
)
def test_what_no_vehicle_does_is_out_of_range(wrong: VehicleMotion) -> None:
    gate = Gate()
    assert gate.refuse(*A, wrong) == "out-of-range"
    assert gate.freshness.newest_ns is None


def test_a_preview_that_lies_ahead_is_believed() -> None:
    assert Gate().refuse(*A, motion(preview=preview([0.0, 0.05, 1.0], x=5.0))) is None
    one = Preview(frozen([0.5]), frozen(np.zeros((1, 3))), frozen(np.zeros((1, 3))))
    assert Gate().refuse(*A, motion(preview=one)) is None
