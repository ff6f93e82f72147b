"""Rates and attitude, speed and acceleration, preview and cue: how they are compared, to the edge.

Packets come every 125 ms, four to a comparison. What a quantity gains in half a second is told by
the first packet of the half second alone, so that every sum is exact.
"""

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motions import motion, preview
from scipy.spatial.transform import Rotation

from motionserver.core.axes import GRAVITY
from motionserver.core.intake.agreement import Agreement, PreviewAgreement
from motionserver.core.kinematics.rotation import gravity_in_body
from motionserver.core.state import DriveMode, VehicleMotion

PAIRS = ("roll", "pitch", "speed", "turn")
LEAST = {"roll": 0.03, "pitch": 0.03, "speed": 0.5, "turn": 0.5}
SPEED = 8.0


def half_seconds(pair: str, gains: Iterable[tuple[float, float]], **more: Any) -> Iterator[Any]:
    """Packets in which the first and the second of a pair gain so much in each half second."""
    value = 0.0
    yield packet(0, pair, value, 0.0, 0.0, **more)
    for k, (first, second) in enumerate(gains):
        for j in range(4):
            once = (first, second) if j == 0 else (0.0, 0.0)
            value += once[0]
            yield packet(4 * k + j + 1, pair, value, *once, **more)


def packet(
    k: int, pair: str, value: float, first: float, second: float, **more: Any
) -> VehicleMotion:
    # an acceleration counts for 125 ms, a rate for half of that on both sides of its packet
    told: dict[str, Any] = {"attitude": (0.0, 0.0), "speed": SPEED, "speed_known": True}
    if pair == "roll":
        told |= {"attitude": (value, 0.0), "rates": (8.0 * second, 0.0, 0.0)}
    elif pair == "pitch":
        told |= {"attitude": (0.0, value), "rates": (0.0, 8.0 * second, 0.0)}
    elif pair == "speed":
        told |= {"speed": SPEED + value, "force": (8.0 * second, 0.0, GRAVITY)}
    else:
        told["rates"] = (0.0, 0.0, 8.0 * first / SPEED)
        told["force"] = (0.0, 8.0 * second, GRAVITY)
    return motion(125.0 * k, k, **(told | more))


def said(pair: str, gains: Iterable[tuple[float, float]], **more: Any) -> str:
    agreement = Agreement()
    for told in half_seconds(pair, gains, **more):
        agreement.heard(told)
    return agreement.complaint


def there_and_back(first: float, second: float, count: int = 8) -> list[tuple[float, float]]:
    return [(first, second), (-first, -second)] * (count // 2)


def below(value: float) -> float:
    return float(np.nextafter(value, 0.0))


@pytest.mark.parametrize("pair", PAIRS)
def test_a_factor_is_told_from_the_size_on_that_tells_something(pair: str) -> None:
    least, less = LEAST[pair], LEAST[pair] * (1.0 - 2.0**-40)
    assert "by a factor of 4.0" in said(pair, there_and_back(least, least / 4.0))
    assert said(pair, there_and_back(less, less / 4.0)) == ""
    # whichever of the two is the larger one
    assert "by a factor of 4.0" in said(pair, there_and_back(least / 4.0, least))
    assert said(pair, there_and_back(less / 4.0, less)) == ""


@pytest.mark.parametrize(
    ("pair", "words"),
    [
        (
            "roll",
            "roll and the roll rate disagree by a factor of 8.0 (2 and 0.25 rad in half a second): "
            "a unit is wrong (roll and p are in rad, positive left side up)",
        ),
        (
            "pitch",
            "pitch and the pitch rate disagree by a factor of 8.0 (2 and 0.25 rad in half a "
            "second): a unit is wrong (pitch and q are in rad, positive nose down)",
        ),
        (
            "speed",
            "speed and the forward acceleration disagree by a factor of 8.0 (2 and 0.25 m/s in "
            "half a second): a unit is wrong (x is forward, in m/s and m/s2)",
        ),
        (
            "turn",
            "speed times yaw rate and the lateral acceleration disagree by a factor of 8.0 (2 and "
            "0.25 m/s in half a second): a unit is wrong (y is to the left, in m/s2, and the yaw "
            "rate positive to the left, in rad/s)",
        ),
    ],
)
def test_a_unit_that_is_wrong_is_named_with_both_figures_and_the_remedy(
    pair: str, words: str
) -> None:
    # of pitch there is less, or it would be too steep to tell
    size = 0.125 if pair == "pitch" else 1.0
    found = said(pair, there_and_back(2.0 * size, 0.25 * size))
    assert found == words.replace("(2 and 0.25 ", f"({2.0 * size:.2g} and {0.25 * size:.2g} ")


@pytest.mark.parametrize("pair", PAIRS)
def test_what_rises_when_the_other_falls_has_a_wrong_sign(pair: str) -> None:
    gains = there_and_back(1.0, -1.0)
    assert "when one rises the other falls: a sign is wrong (" in said(pair, gains)
    assert said(pair, there_and_back(1.0, 1.0)) == ""


def mixed(alike: int, opposite: int, first: float, second: float) -> list[tuple[float, float]]:
    return [(first, second)] * alike + [(first, -second)] * opposite


def test_a_sign_is_wrong_if_nearly_all_comparisons_are_opposite() -> None:
    assert "sign" in said("roll", mixed(3, 17, 1.0, 1.0)), "a correlation of -0.7"
    assert said("roll", mixed(4, 16, 1.0, 1.0)) == ""
    assert "sign" in said("roll", mixed(3, 17, 1.0, 0.125)), "a sign before a factor"


def test_a_unit_is_wrong_if_nearly_all_comparisons_are_alike() -> None:
    assert said("roll", mixed(19, 1, 1.0, 0.25)) == "", "a correlation of 0.9"
    assert "factor" in said("roll", mixed(20, 0, 1.0, 0.25))


def test_a_factor_of_three_may_be_and_more_may_not() -> None:
    assert said("roll", there_and_back(0.75, 0.25)) == ""
    assert said("roll", there_and_back(0.25, 0.75)) == ""
    more = float(np.nextafter(0.75, 1.0))
    assert "by a factor of 3.0" in said("roll", there_and_back(more, 0.25))
    assert "by a factor of 3.0" in said("roll", there_and_back(0.25, more))


def test_what_is_told_by_one_of_the_two_only_tells_nothing() -> None:
    assert "by a factor of 1000.0" in said("roll", there_and_back(1.0, 1e-3))
    assert said("roll", there_and_back(1.0, below(1e-3))) == ""
    assert said("roll", there_and_back(below(1e-3), 1.0)) == ""
    assert said("roll", there_and_back(0.0, 0.0)) == ""


def test_eight_comparisons_are_needed() -> None:
    assert said("roll", [(1.0, -1.0)] * 7) == ""
    assert said("roll", [(1.0, -1.0)] * 8) != ""
    packets = list(half_seconds("roll", [(1.0, -1.0)] * 8))
    agreement = Agreement()
    for told in packets[:-1]:
        agreement.heard(told)
    assert agreement.complaint == "", "and the eighth ends with its half second"


def test_twenty_comparisons_are_judged_together() -> None:
    gains = mixed(30, 0, 1.0, 0.25)
    assert said("roll", gains) != ""
    assert said("roll", [*gains, (1.0, -0.25)]) == "", "19 of 20 are not alike enough"
    assert said("roll", [*gains, (1.0, -0.25), *mixed(19, 0, 1.0, 0.25)]) == ""
    assert said("roll", [*gains, (1.0, -0.25), *mixed(20, 0, 1.0, 0.25)]) != ""


def test_speed_is_compared_where_nobody_reverses() -> None:
    """At 5 m/s and more; a speed that is not known is not compared."""

    def found(speed: float, known: bool = True) -> str:
        agreement = Agreement()
        for told in half_seconds("turn", there_and_back(1.0, -1.0), speed=speed, speed_known=known):
            agreement.heard(told)
        return agreement.complaint

    assert "sign" in found(5.0)
    assert found(below(5.0)) == ""
    assert found(50.0, known=False) == ""


def test_an_attitude_that_is_not_told_is_not_compared_and_neither_is_what_needs_it() -> None:
    for pair in PAIRS:
        assert said(pair, there_and_back(1.0, -1.0), attitude=None) == ""


@pytest.mark.parametrize("which", [1, 2, 4])
@pytest.mark.parametrize("pair", PAIRS)
@pytest.mark.parametrize(
    "change", [{"attitude": None}, {"attitude": (0.0, 1.5)}, {"mode": DriveMode.PAUSE}]
)
def test_a_half_second_with_one_packet_that_cannot_be_compared_is_left_out(
    pair: str, which: int, change: dict[str, Any]
) -> None:
    agreement = Agreement()
    for k, told in enumerate(half_seconds(pair, there_and_back(1.0, -1.0, 80))):
        replaced = motion(
            125.0 * k,
            k,
            force=told.force,
            rates=told.rates,
            **{
                "attitude": told.attitude,
                "speed": told.speed,
                "speed_known": told.speed_known,
                **(change if k % 4 == which % 4 else {}),
            },
        )
        agreement.heard(replaced)
    assert agreement.complaint == ""


@pytest.mark.parametrize(("every", "is_judged"), [(5, False), (6, True)])
def test_neither_the_step_to_a_pause_nor_the_one_from_it_is_compared(every, is_judged) -> None:
    """Every fifth packet pauses: three steps are left between pauses, 375 ms. Every sixth: four."""
    agreement = Agreement()
    for k in range(200):
        mode = DriveMode.DRIVE if k % every else DriveMode.PAUSE
        told = motion(125.0 * k, attitude=(0.25 * k, 0.0), rates=(-2.0, 0.0, 0.0), mode=mode)
        agreement.heard(told)
    assert bool(agreement.complaint) is is_judged


def test_close_to_upright_angles_are_not_compared() -> None:
    def found(pitch: float) -> str:
        agreement = Agreement()
        for told in half_seconds("turn", there_and_back(1.0, -1.0), attitude=(0.0, pitch)):
            agreement.heard(told)
        return agreement.complaint

    for sign in (1.0, -1.0):
        assert "lateral" in found(sign * 1.47)
        assert found(sign * float(np.nextafter(1.47, 2.0))) == ""


def test_comparisons_go_on_after_what_could_not_be_compared() -> None:
    agreement = Agreement()
    packets = list(half_seconds("roll", [(1.0, -1.0)] * 9))
    for told in packets[: 4 * 7 + 1]:
        agreement.heard(told)
    agreement.heard(motion(125.0 * (4 * 7 + 1), attitude=None))
    for told in packets[4 * 7 + 2 : 4 * 8 + 1]:
        agreement.heard(told)
    assert agreement.complaint == ""
    for told in packets[4 * 8 + 1 :]:
        assert agreement.complaint == ""
        agreement.heard(told)
    assert "sign" in agreement.complaint


@pytest.mark.parametrize("share", [1.0, 0.25])
@pytest.mark.parametrize(("roll", "pitch"), [(0.2, -0.3), (-0.3, 0.2)])
def test_a_slope_is_taken_off_before_accelerations_are_compared(roll, pitch, share) -> None:
    """On a slope a car feels gravity's share forwards and sideways as well."""
    gravity = gravity_in_body(np.array(roll), np.array(pitch))
    faster, bend = Agreement(), Agreement()
    for k in range(1000):
        at = 0.01 * k
        forwards = share * 4.0 * np.cos(2.0 * at) + gravity[0], gravity[1], gravity[2]
        told = {"attitude": (roll, pitch), "speed_known": True}
        faster.heard(motion(10.0 * k, force=forwards, speed=20.0 + 2.0 * np.sin(2.0 * at), **told))
        turn = 0.2 * np.sin(2.0 * at)
        left = gravity[0], share * 20.0 * turn + gravity[1], gravity[2]
        bend.heard(motion(10.0 * k, force=left, rates=(0.0, 0.0, turn), speed=20.0, **told))
    if share == 1.0:
        assert faster.complaint == bend.complaint == ""
    else:
        assert "speed and the forward acceleration disagree by a factor of 4.0" in faster.complaint
        assert "and the lateral acceleration disagree by a factor of 4.0" in bend.complaint


def turning(k: int, scale: float, roll_moves: float, pitch_moves: float) -> VehicleMotion:
    """A body that turns about all three axes, its rates as rotations say, times ``scale``."""

    def angles(at: float) -> tuple[float, float, float]:
        roll = 0.8 + roll_moves * np.sin(2.1 * at)
        pitch = 0.7 + pitch_moves * np.sin(1.7 * at)
        return 0.9 * at, pitch, roll

    at, step = 0.01 * k, 1e-5
    before = Rotation.from_euler("ZYX", angles(at - step))
    after = Rotation.from_euler("ZYX", angles(at + step))
    rates = scale * (before.inv() * after).as_rotvec() / (2.0 * step)
    _, pitch, roll = angles(at)
    return motion(10.0 * k, k, rates=tuple(rates.tolist()), attitude=(roll, pitch))


@pytest.mark.parametrize(("roll_moves", "pitch_moves"), [(0.3, 0.0), (0.0, 0.3)])
def test_far_from_level_rates_are_those_of_the_angles(roll_moves, pitch_moves) -> None:
    def found(scale: float) -> str:
        agreement = Agreement()
        for k in range(1000):
            agreement.heard(turning(k, scale, roll_moves, pitch_moves))
        return agreement.complaint

    assert found(1.0) == ""
    name = "roll" if roll_moves else "pitch"
    assert f"{name} and the {name} rate disagree by a factor of 4.0" in found(0.25)
    assert f"{name} and the {name} rate disagree, when one rises" in found(-1.0)


@pytest.mark.parametrize(("gap_ms", "is_judged"), [(199, True), (200, False)])
def test_packets_that_are_far_apart_are_not_compared(gap_ms: int, is_judged: bool) -> None:
    agreement = Agreement()
    for k in range(100):
        told = motion(gap_ms * k, attitude=(0.1 * k, 0.0), rates=(-1.0, 0.0, 0.0))
        agreement.heard(told)
    assert bool(agreement.complaint) is is_judged


def test_a_comparison_begins_anew_after_a_gap() -> None:
    """A quarter of a second before the gap and one after it are no half second."""
    agreement = Agreement()
    at = 0.0
    for _ in range(100):
        for _ in range(3):
            agreement.heard(motion(at, attitude=(at, 0.0), rates=(-1000.0, 0.0, 0.0)))
            at += 125.0
        at += 1000.0
    assert agreement.complaint == ""


def test_what_disagrees_first_is_named_first_and_a_preview_last() -> None:
    far = preview([0.1], x=50.0)
    assert "preview" in said("roll", there_and_back(1.0, 1.0), preview=far)
    assert "roll" in said("roll", there_and_back(1.0, -1.0), preview=far)


def shown(differences: Iterable[float], begins: float = 0.1, step_ms: float = 100.0) -> str:
    agreement = PreviewAgreement()
    for k, apart in enumerate(differences):
        agreement.heard(motion(step_ms * k, preview=preview([begins, 1.0], x=apart)))
    return agreement.complaint


def test_a_preview_is_judged_by_the_median_of_eight_first_samples() -> None:
    assert shown([4.5] * 7) == ""
    assert shown([4.5] * 8) == (
        "the preview's first sample is 4.5 m/s2 from the cue in the median: both need the same "
        "axes, unit and gravity flag"
    )
    assert shown([4.0] * 8) == "", "which a forecast may be"
    assert shown([float(np.nextafter(4.0, 5.0))] * 8) != ""
    assert shown([0.0] * 4 + [9.0] * 4) != "", "4.5 in the median"
    assert shown([0.0] * 5 + [9.0] * 4) == ""
    assert shown([9.0] * 4 + [0.0] * 5) == ""


def test_a_preview_that_begins_later_is_no_sample_of_now() -> None:
    assert shown([9.0] * 8, begins=0.2) != ""
    assert shown([9.0] * 8, begins=float(np.nextafter(0.2, 1.0))) == ""
    agreement = PreviewAgreement()
    for k in range(8):
        agreement.heard(motion(100.0 * k))
    assert agreement.complaint == ""


def test_ten_first_samples_a_second_are_noted_and_the_last_twenty_judged() -> None:
    assert shown([9.0] * 8, step_ms=99.0) == ""
    assert shown([9.0] * 15, step_ms=50.0) != ""
    assert shown([9.0] * 14, step_ms=50.0) == ""
    assert shown([0.0] * 30 + [9.0] * 10) != "", "4.5 in the median of twenty"
    assert shown([0.0] * 30 + [9.0] * 9) == ""
    assert shown([9.0] * 30 + [0.0] * 11) == ""
    assert shown([9.0] * 30 + [0.0] * 10) != ""


@given(st.floats(0.0, 1e6), st.integers(0, 10**12))
def test_when_a_stream_begins_says_nothing(apart: float, begin_ms: int) -> None:
    agreement = PreviewAgreement()
    for k in range(8):
        at = float(begin_ms + 100 * k)
        agreement.heard(motion(at, preview=preview([0.0], x=apart)))
    assert bool(agreement.complaint) is (apart > 4.0)
