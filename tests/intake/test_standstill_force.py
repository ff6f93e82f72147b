"""When a force is judged that a vehicle feels at rest or in steady motion, and against what."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest
from motions import motion

from motionserver.core.axes import GRAVITY
from motionserver.core.intake.standstill import StandstillForce
from motionserver.core.state import DriveMode

UP = (0.0, 0.0, GRAVITY)
TWICE = (0.0, 0.0, 2.0 * GRAVITY)
STANDS = {"speed": 0.0, "speed_known": True}
DRIVES = {"speed": 20.0, "speed_known": True}


def heard(told: Iterable[dict[str, Any]], step_ms: float = 50.0, **more: Any) -> str:
    checks = StandstillForce()
    for k, one in enumerate(told):
        checks.heard(motion(step_ms * k, k, **(more | one)))
    return checks.complaint


def felt(force: tuple[float, float, float], count: int = 21, **more: Any) -> str:
    """A force felt so many times, 50 ms apart: 21 packets are a second."""
    return heard([{"force": force}] * count, **(STANDS | more))


def exactly(size: float, forward: float = 0.0, **more: Any) -> str:
    """A force felt so often that the mean is that force to the last bit."""
    counts = range(6, 61)
    count = next(n for n in counts if np.array([(0.0, 0.0, size)] * n).mean(axis=0)[2] == size)
    told = [{"force": (forward, 0.0, size)}] * count
    return heard(told, step_ms=math.ceil(1000 / (count - 1)), **(STANDS | more))


def above(value: float) -> float:
    return float(np.nextafter(value, math.inf))


def test_a_second_of_standing_is_judged() -> None:
    assert felt(TWICE, 20) == ""
    assert "twice" in felt(TWICE, 21)


@pytest.mark.parametrize("speed", [20.0, -20.0, 0.11, -0.11])
def test_three_seconds_of_steady_motion_are_judged(speed: float) -> None:
    assert felt(TWICE, 60, speed=speed) == ""
    found = felt(TWICE, 61, speed=speed)
    assert found.startswith("in steady straight motion the specific force is 19.62 m/s2, ")


@pytest.mark.parametrize(
    ("speed", "stands"), [(0.1, True), (-0.1, True), (above(0.1), False), (-above(0.1), False)]
)
def test_who_is_slow_stands(speed: float, stands: bool) -> None:
    found = felt((0.0, 0.0, 14.0), 61, speed=speed)
    assert (found != "") is stands
    assert found.startswith("at standstill" if stands else "")


def test_whose_speed_is_unknown_is_judged_after_a_second_as_one_that_may_move() -> None:
    assert felt(TWICE, 20, speed_known=False) == ""
    assert "twice" in felt(TWICE, 21, speed_known=False)
    assert "twice" in felt(TWICE, 21, speed_known=False, speed=20.0)
    assert felt((0.0, 0.0, 14.0), 21, speed_known=False) == ""


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_who_turns_does_not_stand(axis: int) -> None:
    rates = [0.0, 0.0, 0.0]
    for sign in (1.0, -1.0):
        rates[axis] = sign * 0.05
        assert "twice" in felt(TWICE, rates=tuple(rates))
        rates[axis] = sign * above(0.05)
        assert felt(TWICE, rates=tuple(rates)) == ""


@pytest.mark.parametrize(
    "other",
    [{"rates": (0.0, 0.1, 0.0)}, {"mode": DriveMode.PAUSE}, {"speed": 1.0}],
)
def test_it_must_stand_without_a_break(other: dict[str, Any]) -> None:
    stands: dict[str, Any] = {"force": TWICE}
    assert heard([*[stands] * 20, stands | other, *[stands] * 20], **STANDS) == ""
    assert heard([*[stands] * 20, stands | other, *[stands] * 21], **STANDS) != ""


def test_what_was_felt_before_a_break_does_not_count() -> None:
    """Braking hard to a halt: 3 m/s2 were felt before, while the speed was known to be 5 m/s."""
    brakes = {"force": (-3.0, 0.0, GRAVITY), "speed": 5.0}
    wrong = {"force": TWICE, "speed": 0.0}
    assert heard([*[brakes] * 20, *[wrong] * 21], speed_known=True) != ""


def test_six_packets_are_needed() -> None:
    assert heard([{"force": TWICE}] * 5, step_ms=1000.0, **STANDS) == ""
    assert heard([{"force": TWICE}] * 6, step_ms=1000.0, **STANDS) != ""


def test_twenty_packets_a_second_are_enough() -> None:
    """Those in between are not looked at: one shock per 50 ms is not seen."""
    told = [{"force": TWICE if k % 5 == 0 else UP} for k in range(101)]
    assert "twice" in heard(told, step_ms=10.0, **STANDS)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_force_that_changes_is_no_standstill(axis: int) -> None:
    other = [0.0, 0.0, 16.0]
    other[axis] += 0.5
    told = [{"force": (0.0, 0.0, 16.0)}] * 20 + [{"force": tuple(other)}]
    assert heard(told, **STANDS) != ""
    other[axis] += 1e-9
    told[-1] = {"force": tuple(other)}
    assert heard(told, **STANDS) == ""


def test_it_is_waited_anew_after_a_force_that_changed() -> None:
    shaken = [{"force": (0.0, 0.0, 16.0)}] * 20 + [{"force": (0.0, 0.0, 17.0)}]
    steady: list[dict[str, Any]] = [{"force": (0.0, 0.0, 16.0)}]
    assert heard([*shaken, *steady * 20], **STANDS) == ""
    assert heard([*shaken, *steady * 21], **STANDS) != ""


def test_each_second_is_judged_for_itself() -> None:
    first, right = [{"force": TWICE}] * 21, [{"force": UP}]
    assert heard([*first, *right * 19], **STANDS) != ""
    assert heard([*first, *right * 20], **STANDS) == ""


def test_a_drive_clears_no_complaint() -> None:
    told = [{"force": TWICE}] * 21 + [{"force": UP, "speed": 20.0}] * 200
    assert heard(told, speed=0.0, speed_known=True) != ""


@pytest.mark.parametrize("size", [GRAVITY - 0.5, GRAVITY + 0.5])
def test_half_a_metre_is_borne_and_no_more(size: float) -> None:
    assert exactly(size) == ""
    beyond = size + math.copysign(1e-9, size - GRAVITY)
    assert f"is {size:.2f} m/s2, it must be 9.81 within 0.5" in felt((0.0, 0.0, beyond))


def test_of_a_drive_only_gravity_that_is_missing_or_doubled_is_told() -> None:
    for edge, inwards in ((0.5, -1e-9), (2 * GRAVITY - 0.5, 1e-9), (2 * GRAVITY + 0.5, -1e-9)):
        assert exactly(edge, speed_known=False) == ""
        assert felt((0.0, 0.0, edge + inwards), speed_known=False) != ""


@pytest.mark.parametrize(
    ("size", "said"),
    [
        (2.0 * GRAVITY, "gravity is counted twice. The values contain it: set the flag "),
        (2.0 * GRAVITY - 0.99, "gravity is counted twice"),
        (2.0 * GRAVITY + 0.99, "gravity is counted twice"),
        (2.0 * GRAVITY - 1.0, "check the unit (m/s2) and whether the flag GRAVITY_INCLUDED"),
        (2.0 * GRAVITY + 1.0, "check the unit (m/s2)"),
        (0.0, "gravity is missing. Clear the flag GRAVITY_INCLUDED if the values do not"),
        (0.9 - 1e-9, "gravity is missing"),
        (0.9, "is it sent in g? It must be in m/s2"),
        (1.0, "is it sent in g?"),
        (1.1, "is it sent in g?"),
        (1.1 + 1e-9, "check the unit (m/s2)"),
        (5.0, "check the unit (m/s2)"),
        (32.2, "check the unit (m/s2)"),
    ],
)
def test_the_likely_cause_is_named(size: float, said: str) -> None:
    is_edge = size in (0.9, 1.1, 2.0 * GRAVITY - 1.0, 2.0 * GRAVITY + 1.0)
    found = exactly(size) if is_edge else felt((0.0, 0.0, size))
    assert f"at standstill the specific force is {size:.2f} m/s2" in found
    assert f": {said}" in found


def test_without_an_attitude_a_force_that_points_up_may_be_a_slope() -> None:
    assert felt((6.0, 0.0, 7.761)) == ""
    assert felt((9.8, 0.0, 0.5)) == ""
    assert "check axes and signs" in felt((6.0, 0.0, -7.761))
    assert "check axes and signs" in felt((9.81, 0.0, 0.0)), "on its nose or tail"


def test_in_an_attitude_the_force_is_gravity_within_one_and_a_half() -> None:
    assert exactly(GRAVITY, 1.5, attitude=(0.0, 0.0)) == ""
    # level but for a force sideways: as long as gravity, and so far from it
    for apart, is_right in ((1.499, True), (1.501, False)):
        lean = 2.0 * math.asin(apart / 2.0 / GRAVITY)
        force = (0.0, GRAVITY * math.sin(lean), GRAVITY * math.cos(lean))
        assert (felt(force, attitude=(0.0, 0.0)) == "") is is_right
        assert felt(force, attitude=(lean, 0.0)) == ""


def test_what_was_felt_and_what_must_be_are_told() -> None:
    force = (0.0, 0.0, -GRAVITY)
    assert felt(force, attitude=(math.pi / 2.0, 0.0)) == (
        "at standstill the specific force is (0.00, 0.00, -9.81) m/s2, in the told attitude it "
        "must be (-0.00, 9.81, 0.00): check axes and signs (x forward, y left, z up; roll positive "
        "left side up, pitch positive nose down)"
    )
    assert "it must be (9.81, 0.00, 0.00)" in felt(force, attitude=(0.0, -math.pi / 2.0))
    assert "it must be (0.00, 0.00, 9.81)" in felt(force)
