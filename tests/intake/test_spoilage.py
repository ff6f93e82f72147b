"""A sender of whose packets more than a tenth is bad is not driven on."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st
from motions import motion

from motionserver.core.intake.freshness import SECOND_NS
from motionserver.core.intake.gate import Gate
from motionserver.core.intake.spoilage import FEWEST, Spoilage

A = ("native", "10.0.0.1:5")
B = ("native", "10.0.0.2:5")
MS = 1_000_000


def after(*verdicts: bool) -> tuple[Spoilage, int]:
    spoilage = Spoilage()
    for k, is_bad in enumerate(verdicts):
        spoilage.heard(10 * MS * k, is_bad=is_bad)
    return spoilage, 10 * MS * (len(verdicts) - 1)


@pytest.mark.parametrize(
    ("good", "bad", "share", "spoilt"),
    [(9, 1, 0.1, False), (18, 2, 0.1, False), (8, 2, 0.2, True), (17, 2, 2 / 19, True)],
)
def test_more_than_a_tenth_is_too_much(good: int, bad: int, share: float, spoilt: bool) -> None:
    spoilage, now = after(*[False] * good, *[True] * bad)
    assert spoilage.share(now) == pytest.approx(share)
    assert spoilage.is_spoilt(now) == spoilt


def test_a_few_packets_tell_nothing() -> None:
    spoilage, now = after(*[True] * (FEWEST - 1))
    assert not spoilage.is_spoilt(now)
    spoilage.heard(now, is_bad=True)
    assert spoilage.is_spoilt(now)


def test_only_the_last_second_counts() -> None:
    spoilage, now = after(*[True] * 20)
    last = now + SECOND_NS - 90 * MS
    assert spoilage.share(last) == 1.0
    assert spoilage.share(last + 1) == 0.0


@given(st.lists(st.tuples(st.integers(0, SECOND_NS // 4), st.booleans()), max_size=200))
def test_the_share_is_that_of_a_plain_count(heard: list[tuple[int, bool]]) -> None:
    spoilage = Spoilage()
    times = list(itertools.accumulate(gap for gap, _ in heard))
    for now, (_, is_bad) in zip(times, heard, strict=True):
        spoilage.heard(now, is_bad=is_bad)
    if not times:
        return
    last = [bad for at, (_, bad) in zip(times, heard, strict=True) if at >= times[-1] - SECOND_NS]
    expected = sum(last) / len(last) if len(last) >= FEWEST else 0.0
    assert spoilage.share(times[-1]) == pytest.approx(expected)


def test_a_flood_of_bad_packets_is_kept_in_bounds() -> None:
    spoilage = Spoilage()
    for _ in range(10_000):
        spoilage.heard(0, is_bad=True)
    assert spoilage.share(0) == 1.0
    for _ in range(4096):
        spoilage.heard(1, is_bad=False)
    assert spoilage.share(1) == 0.0


def driven(bad_from: tuple[str, str]) -> Gate:
    """A second of good packets, every fifth followed by one that cannot be."""
    gate = Gate()
    for k in range(100):
        assert gate.refuse(*A, motion(10.0 * k, k)) is None
        if k % 5 == 0:
            gate.spoilt(*bad_from, 10 * MS * k)
    return gate


def test_an_owner_that_sends_too_much_nonsense_is_not_fresh() -> None:
    now = 990 * MS
    assert not driven(A).is_fresh(now)
    assert driven(A).believed_ns(now, is_cued=True) == 0
    assert driven(B).believed_ns(now, is_cued=False) == now
    assert driven(B).is_fresh(now), "a stranger's nonsense is not the owner's fault"
    gate = driven(A)
    for k in range(100, 201):
        assert gate.refuse(*A, motion(10.0 * k, k)) is None
    assert gate.is_fresh(2000 * MS), "it mends by itself"


def test_what_cannot_be_is_nonsense_too() -> None:
    gate = Gate()
    for k in range(50):
        gate.refuse(*A, motion(10.0 * k, 2 * k))
        gate.refuse(*A, motion(10.0 * k + 5.0, 2 * k + 1, x=1e6 if k % 2 else 0.0))
    assert not gate.is_fresh(495 * MS)


def test_before_the_first_owner_nobody_spoils() -> None:
    gate = Gate()
    for k in range(50):
        gate.spoilt(*A, k)
    gate.refuse(*A, motion(0.0, 1))
    assert gate.is_fresh(0)
    assert gate.spoilage.share(0) == 0.0


def test_of_nothing_or_of_what_is_long_past_no_share_is_bad() -> None:
    assert Spoilage().share(5 * SECOND_NS) == 0.0
    spoilage, now = after(*[True] * 20)
    assert spoilage.is_spoilt(now)
    assert spoilage.share(now + 3 * SECOND_NS) == 0.0
