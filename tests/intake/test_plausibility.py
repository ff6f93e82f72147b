"""Wrong units keep a drive from beginning, and never end one."""

import numpy as np
import pytest
from motions import MS, motion

from motionserver.core.axes import GRAVITY
from motionserver.core.intake.gate import Gate
from motionserver.core.state import DriveMode

OWNER = ("native", "10.0.0.1:5")
G = (0.0, 0.0, GRAVITY)


def heard(seconds: float, force=G, rates=(0.0, 0.0, 0.0), mode=DriveMode.DRIVE) -> Gate:
    gate = Gate()
    for k in range(round(100 * seconds)):
        told = motion(10.0 * k, k, force=force, rates=rates, mode=mode)
        assert gate.refuse(*OWNER, told) is None
    return gate


def believed(gate: Gate, is_cued: bool = False) -> bool:
    newest = gate.freshness.newest_ns
    assert newest is not None
    return gate.believed_ns(newest, is_cued) == newest


@pytest.mark.parametrize(
    ("force", "rates", "word"),
    [
        ((0.1, 0.0, 1.0), (0.0, 0.0, 0.0), "m/s2"),
        ((0.5, 0.2, 0.0), (0.0, 0.0, 0.0), "gravity flag"),
        ((0.0, 0.0, 32.2), (0.0, 0.0, 0.0), "m/s2"),
        (G, (0.0, 0.0, 10.0), "rad/s"),
    ],
)
def test_units_that_cannot_be_are_told_and_keep_it_from_beginning(force, rates, word) -> None:
    gate = heard(6.0, force, rates)
    assert word in gate.plausibility.complaint()
    assert not believed(gate)
    assert believed(gate, is_cued=True), "what already moves is not stopped by a guess"


@pytest.mark.parametrize(
    ("force", "rates"),
    [(G, (0.0, 0.0, 0.0)), ((8.0, 0.0, GRAVITY), (0.0, 0.0, 1.0)), ((0.0, 0.0, 4.0), (2.9, 0, 0))],
)
def test_what_vehicles_do_is_believed(force, rates) -> None:
    gate = heard(12.0, force, rates)
    assert gate.plausibility.complaint() == ""
    assert believed(gate)


@pytest.mark.parametrize(
    ("force", "rate", "is_told"),
    [
        (0.4 * 9.81, 0.0, False),
        (np.nextafter(0.4 * 9.81, 0.0), 0.0, True),
        (3.0 * 9.81, 0.0, False),
        (np.nextafter(3.0 * 9.81, 99.0), 0.0, True),
        (9.8, 3.0, False),
        (9.8, np.nextafter(3.0, 4.0), True),
    ],
)
def test_the_edges_themselves_are_what_vehicles_do(force, rate, is_told) -> None:
    gate = heard(6.0, (0.0, 0.0, force), (rate, 0.0, 0.0))
    assert bool(gate.plausibility.complaint()) is is_told


def test_a_complaint_tells_what_was_found_and_what_is_usual() -> None:
    assert "is 1.00 m/s2 in the median of 10 s, a vehicle has 4 to 29" in (
        heard(6.0, (0.0, 0.0, 1.0)).plausibility.complaint()
    )
    assert "is 10.0 rad/s in the median of 10 s, a vehicle has less than 3" in (
        heard(6.0, G, (10.0, 0.0, 0.0)).plausibility.complaint()
    )


def test_nothing_is_said_of_less_than_five_seconds() -> None:
    assert heard(4.9, (0.0, 0.0, 1.0)).plausibility.complaint() == ""
    assert heard(5.0, (0.0, 0.0, 1.0)).plausibility.complaint() != ""


def test_a_shock_is_no_unit() -> None:
    gate = Gate()
    for k in range(1000):
        x = 90.0 if k % 7 == 0 else 0.0
        gate.refuse(*OWNER, motion(10.0 * k, k, x=x, rates=(20.0 * (k % 3 == 0), 0.0, 0.0)))
    assert gate.plausibility.complaint() == ""


def test_a_paused_simulator_may_send_zeros() -> None:
    gate = heard(10.0, (0.0, 0.0, 0.0), mode=DriveMode.PAUSE)
    assert believed(gate)


def test_what_is_long_past_is_forgotten_and_an_heir_begins_anew() -> None:
    gate = heard(10.0, (0.0, 0.0, 1.0))
    for k in range(1000, 1520):
        gate.refuse(*OWNER, motion(10.0 * k, k))
    assert gate.plausibility.complaint() == ""
    wrong = heard(10.0, (0.0, 0.0, 1.0))
    heir = motion(13_000.0, 1, session=2)
    assert wrong.refuse(*OWNER, heir) is None
    assert wrong.plausibility.complaint() == ""
    assert np.isclose(13_000 * MS, heir.arrival_ns)


def test_who_has_wrong_units_is_told_as_one_of_whom_nothing_came() -> None:
    gate = heard(6.0, (0.1, 0.0, 1.0))
    assert gate.believed_ns(5990 * MS, is_cued=False) == 0


def test_what_was_wrong_before_a_silence_is_forgotten() -> None:
    gate = heard(6.0, (0.1, 0.0, 1.0))
    assert gate.plausibility.complaint()
    assert gate.refuse(*OWNER, motion(5990.0 + 2001.0, 600)) is None
    assert gate.plausibility.complaint() == ""
