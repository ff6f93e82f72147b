"""A guard ends at any packet; what its successor sends is what it would have sent itself."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from guard_scenes import STATES, Bench, away, bench, die, in_state, legal, written
from hypothesis import given, settings
from hypothesis import strategies as st
from machines import compact

from motionserver.core.axes import frozen
from motionserver.core.device import Order
from motionserver.core.safety.act import Guard
from motionserver.core.safety.inherit import LONGEST_GAP, inherit
from motionserver.core.safety.will import WillWriter, unpack_will


def follows(b, count):
    """Poses of the next packets that are followed."""
    goal = len(b.sent) + count
    while len(b.sent) < goal:
        b.tick()
    return np.array([s.state.pose for s in b.sent[-count:]])


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("later", [0.0, 0.13, 0.4])
def test_the_next_packets_are_those_of_the_guard_that_ended(state, later):
    b = in_state(state)
    b.run(later)
    other = copy.deepcopy(b)
    written(other)
    assert die(b)
    assert b.record.state == other.record.state
    assert np.array_equal(follows(b, 60), follows(other, 60))
    assert b.state == other.state
    legal(b)


def test_a_sample_that_never_went_out_is_the_next_one_even_if_the_network_refuses_it_first():
    b = bench()
    b.engaged()
    away(b)
    b.tick("park")
    follows(b, 30)
    will = written(b)
    unsent = b.sent[-1].state.pose
    b.guard = Guard(b.config)
    assert inherit(b.guard, will, b.now, is_sent=False)
    refused = follows(b, 1)[0]
    b.guard.told(b.now, False)
    again, after = follows(b, 2)
    assert np.array_equal(refused, unsent)
    assert np.array_equal(again, unsent)
    assert not np.array_equal(after, unsent)


@given(st.integers(0, 200))
@settings(max_examples=25, deadline=None)
def test_in_the_middle_of_a_motion_at_any_packet(packets):
    b = bench()
    b.engaged()
    away(b)
    b.tick("park")
    follows(b, 1 + packets)
    other = copy.deepcopy(b)
    written(other)
    die(b)
    assert np.array_equal(follows(b, 20), follows(other, 20))
    legal(b)


def test_again_and_again_it_is_still_the_same_motion():
    b = bench()
    b.engaged()
    away(b)
    b.tick("park")
    other = copy.deepcopy(b)
    follows(other, 40)
    for _ in range(20):
        assert die(b)
        follows(b, 1)
    assert np.array_equal(
        [s.state.pose for s in b.sent[-40:]], [s.state.pose for s in other.sent[-40:]]
    )
    assert b.record.counters["takeovers"] == 20


def test_after_a_long_gap_it_begins_where_the_platform_stands_and_parks():
    b = in_state("RUN")
    assert not die(b, LONGEST_GAP + 0.05)
    assert b.state == "OFFLINE"
    b.until("PARKING", 2.0)
    b.until("PARKED", 20.0)
    assert "begins anew: its packet was due 133 ms ago" in str(b.record.events)
    legal(b)


@pytest.mark.parametrize("gap", [0.0, 0.5, 60.0])
def test_a_latched_state_stays_latched_however_late(gap):
    b = in_state("RUN")
    b.device.faults = ("drive 3",)
    b.until("FAULT", 1.0)
    b.device.faults = ()
    b.run(0.1)
    die(b, gap)
    assert b.state == "FAULT"
    b.run(5.0)
    assert b.state == "FAULT"
    legal(b)


def test_who_took_over_a_moment_ago_does_not_pass_it_on():
    b = in_state("RUN")
    assert not die(b, taken_ns=b.now - 500_000_000)
    assert "it had taken over itself just before" in str(b.record.events)
    b = in_state("RUN")
    assert die(b, taken_ns=b.now - 1_500_000_000)


def test_the_single_edge_of_auto_stays_used():
    b = Bench(compact(), engage="auto")
    b.until("RUN", 20.0)
    die(b, 1.0)
    b.until("PARKED", 20.0)
    b.run(3.0)
    assert b.state == "PARKED"
    assert not any(s.order is Order.RAISE for s in b.sent[-150:])


def test_without_an_answer_of_the_device_the_next_one_will_do():
    b = in_state("RUN")
    will = replace(written(b), feedback=None)
    b.guard = Guard(b.config)
    assert inherit(b.guard, will, b.now)
    b.run(1.0)
    assert b.state == "RUN"
    legal(b)


def test_a_base_that_measures_nothing_is_believed_to_follow():
    b = in_state("RUN")
    b.device.mute = True
    b.run(0.1)
    assert die(b)
    b.run(0.5)
    assert b.state == "RUN"
    legal(b)


def test_plans_that_are_not_allowed_are_not_played():
    b = in_state("RUN")
    will = written(b)
    wild = replace(will.plans[-1], pose=frozen(10.0 * will.plans[-1].pose + 0.5))
    b.guard = Guard(b.config)
    assert not inherit(b.guard, replace(will, plans=(*will.plans[:-1], wild)), b.now)
    assert b.record.playback is None
    b.until("PARKED", 20.0)
    legal(b)


def test_a_clock_that_does_not_fit_the_platform_is_not_believed():
    b = in_state("RUN")
    b.tick("park")
    follows(b, 50)
    will = written(b)
    b.guard = Guard(b.config)
    assert not inherit(b.guard, replace(will, clock=will.clock + 1.5), b.now)
    assert "mm from its plan" in str(b.record.events)
    b.until("PARKED", 20.0)
    legal(b)


@given(st.data())
@settings(max_examples=200, deadline=None)
def test_bytes_that_are_no_will_are_refused_or_harmless(data):
    original = WillWriter().pack(written(in_state_once()))
    kind = data.draw(st.sampled_from(["cut", "flip", "noise"]))
    if kind == "noise":
        content = data.draw(st.binary(max_size=200))
    elif kind == "cut":
        content = original[: data.draw(st.integers(0, len(original) - 1))]
    else:
        place = data.draw(st.integers(0, len(original) - 1))
        content = bytearray(original)
        content[place] ^= data.draw(st.integers(1, 255))
    try:
        will = unpack_will(bytes(content))
    except ValueError:
        return
    guard = Guard(bench().config)
    inherit(guard, will, 10**12)


_KEPT = []


def in_state_once():
    if not _KEPT:
        _KEPT.append(in_state("RUN"))
    return copy.deepcopy(_KEPT[0])
