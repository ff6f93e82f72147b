"""Proposals without a verdict: which are waited for, and which are lost."""

import numpy as np

from motionserver.core.axes import frozen
from motionserver.core.plan import Plan, rest_at
from motionserver.planner.open_proposals import OpenProposals
from motionserver.telemetry.link import GuardClock


def plan(plan_id: int, parent: int) -> Plan:
    rest = rest_at(np.zeros(6), plan_id)
    return Plan(plan_id, parent, 0.0, frozen([0.0, 1.0]), rest.pose, rest.velocity, rest.velocity)


def clock(taken: int = 0, judged: int = 0, newest: int = 5) -> GuardClock:
    return GuardClock(0, newest, 0.0, 0, 0, 0, taken, judged)


def waiting(*plans: tuple[int, int], patience: int = 100) -> OpenProposals:
    """Of (number, parent), a nanosecond apart, from 1000 ns on."""
    proposals = OpenProposals(patience)
    for k, (number, parent) in enumerate(plans):
        proposals.add(plan(number, parent), 1000 + k)
    return proposals


def newest(proposals: OpenProposals) -> int | None:
    return None if proposals.newest is None else proposals.newest.plan_id


def test_without_a_proposal_nothing_waits() -> None:
    proposals = waiting()
    assert newest(proposals) is None
    assert not proposals.are_too_many
    assert not proposals.would_overwrite(plan(6, 5), clock(), 0)
    proposals.forget(clock(), 10**9)


def test_a_child_waits_behind_its_parent_and_a_sibling_takes_its_place() -> None:
    chain = waiting((6, 5), (7, 6), (8, 7))
    assert (newest(chain), chain.proposed_ns) == (8, 1002)
    assert chain.are_too_many
    chain.forget(clock(judged=6), 1003)
    assert chain.are_too_many, "7 and 8 are left"
    chain.forget(clock(judged=7), 1003)
    assert not chain.are_too_many
    assert newest(chain) == 8
    sibling = waiting((6, 5), (7, 6), (9, 5))
    assert not sibling.are_too_many
    assert (newest(sibling), sibling.proposed_ns) == (9, 1002)


def test_a_verdict_about_a_child_is_one_about_its_parent() -> None:
    for told in (clock(judged=7), clock(newest=7)):
        chain = waiting((6, 5), (7, 6), (8, 7))
        chain.forget(told, 1003)
        assert (newest(chain), chain.are_too_many) == (8, False)


def test_a_verdict_about_the_only_one_leaves_none() -> None:
    alone = waiting((6, 5))
    alone.forget(clock(judged=6), 1003)
    assert newest(alone) is None


def test_the_oldest_is_lost_first_once_its_patience_is_over() -> None:
    chain = waiting((6, 5), (7, 6))
    chain.forget(clock(), 1100)
    assert chain.are_too_many
    chain.forget(clock(), 1101)
    assert (newest(chain), chain.are_too_many) == (7, False)
    chain.forget(clock(), 1102)
    assert newest(chain) is None


def test_a_child_of_the_newest_is_held_back_until_that_one_is_read() -> None:
    chain = waiting((6, 5), (7, 6))
    assert waiting((6, 5)).would_overwrite(plan(7, 6), clock(), 1001)
    soon, later = 1001 + 8_333_332, 1001 + 8_333_333
    assert chain.would_overwrite(plan(8, 7), clock(), soon)
    assert not chain.would_overwrite(plan(8, 7), clock(), later), "two ticks at 240 Hz have passed"
    assert not chain.would_overwrite(plan(8, 6), clock(), soon), "it continues another one"
    assert not chain.would_overwrite(plan(8, 7), clock(taken=7), soon)
    assert not chain.would_overwrite(plan(8, 7), clock(judged=7), soon)
    assert chain.would_overwrite(plan(8, 7), clock(taken=6, judged=6), soon)
