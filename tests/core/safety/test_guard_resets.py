"""Resets, and what cannot happen, on virtual time."""

from dataclasses import replace

import numpy as np
import pytest
from device_model import Bench
from guard_scenes import away, in_state, legal, stands
from machines import compact

from motionserver.core.axes import frozen
from motionserver.core.device import Order, Phase
from motionserver.core.motion.player import Playback
from motionserver.core.plan import rest_at
from motionserver.core.safety.accept import accept_rest
from motionserver.core.safety.verdict import AcceptedPlan


def test_reset_is_refused_where_it_makes_no_sense():
    b = Bench(compact()).engaged()
    assert "nothing to reset" in b.tick("reset")[0]
    away(b)
    b.tick("park")
    b.run(1.0)
    b.device.faults = b.device.held_faults = ("torque monitor",)
    b.until("FAULT", 0.1)
    assert "still moves" in b.tick("reset")[0]
    b.run(10.0)
    assert b.tick("reset") == ("",)
    b.run(1.0)
    assert b.sent[-1].order is Order.RESET
    assert "no effect" not in b.guard.reason
    b.run(1.5)
    why = "a reset had no effect for 2 s: the device reports torque monitor"
    assert f"; {why}" in b.guard.reason
    assert [text for _, text in b.record.events].count(why) == 1
    assert b.state == "FAULT"
    assert b.sent[-1].order is Order.PARK
    b.device.held_faults = ()
    b.tick("reset")
    assert "no effect" not in b.guard.reason
    b.until("PARKED", 30.0)
    assert "no effect" not in b.guard.reason


def test_reset_of_a_silent_device_goes_offline():
    b = in_state("RUN")
    b.device.silent = True
    b.until("FAULT", 1.0)
    b.run(5.0)
    assert b.guard.supervisor.device.valid_for(b.now) == 0.0
    assert b.tick("reset") == ("",)
    assert b.state == "OFFLINE"
    b.device.silent = False
    b.until("PARKED", 20.0)
    assert "PARKING" in b.seen
    legal(b)


def test_reset_with_the_device_down_is_parked():
    b = in_state("RUN")
    b.device.faults = ("homing",)
    b.until("FAULT", 0.1)
    b.run(1.0)
    b.device.phase, b.device.legs = Phase.DOWN, b.device.low
    b.tick("reset")
    b.until("PARKED", 1.0)


def test_parked_loses_the_device_and_finds_it_again():
    b = Bench(compact())
    b.until("PARKED", 1.0)
    b.device.silent = True
    b.until("OFFLINE", 0.2)
    b.device.silent = False
    assert b.until("PARKED", 1.0) == pytest.approx(0.3, abs=0.03)


def test_parked_that_finds_itself_up_parks():
    b = Bench(compact())
    b.until("PARKED", 1.0)
    b.device.put_up(np.zeros(6))
    assert b.until("PARKING", 0.5) == pytest.approx(0.3, abs=0.03)
    b.until("PARKED", 10.0)


def test_a_plan_outside_the_stroke_is_never_sent():
    """It cannot be accepted; were it played all the same, it is not sent and the guard faults."""
    b = in_state("RUN")
    last = b.sent[-1].legs
    wrong = rest_at(np.array([0.0, 0.0, 0.5, 0.0, 0.0, 0.0]), 99)
    b.record.playback = Playback(AcceptedPlan(wrong, None, 1.0))
    b.planning = False
    b.run(0.1)
    assert b.state == "FAULT"
    assert "outside the stroke" in b.record.reason
    followed = [s.legs for s in b.sent if s.order is Order.FOLLOW]
    assert followed[-1] == pytest.approx(last, abs=1e-9)
    stands(b)
    inside = [(s.legs >= b.machine.leg_min) & (s.legs <= b.machine.leg_max) for s in b.sent]
    assert np.all(inside)


def test_a_rest_without_a_way_home_is_a_fault():
    b = in_state("PARKING")
    blocked = AcceptedPlan(rest_at(np.array([0.05, 0.0, 0.0, 0.0, 0.0, 0.0]), 99), None, 1.0)
    b.record.playback = Playback(blocked)
    slow = replace(b.machine, pace=replace(b.machine.pace, speed=1e-4))
    b.guard.moves.machine = slow
    b.run(0.2)
    assert b.state == "FAULT"
    assert "no way home" in b.record.reason


def test_a_neutral_nobody_can_stand_at_is_a_fault():
    b = Bench(compact())
    b.until("PARKED", 1.0)
    b.guard.moves.machine = replace(b.machine, leg_min=1.1)
    b.tick()
    b.tick("engage")
    b.until("FAULT", 0.1)
    assert isinstance(
        accept_rest(b.machine, frozen(np.zeros(6)), 1, np.zeros((1, 6))), AcceptedPlan
    )


def test_a_reset_waits_until_the_device_stands_still():
    b = in_state("RUN")
    b.device.faults = ("watchdog",)
    b.until("FAULT", 0.1)
    b.run(1.0)
    b.device.phase = Phase.LOWERING
    b.tick("reset")
    b.run(1.0)
    assert b.state == "FAULT"
    b.device.phase = Phase.DOWN
    b.until("PARKED", 0.1)


def test_a_reset_waits_until_a_raised_device_no_longer_moves():
    b = in_state("RUN")
    b.device.silent = True
    b.until("FAULT", 0.2)
    b.run(5.0)
    b.device.silent = False
    begin = np.array(b.device.legs)
    for k in range(240):
        # it is moved by something else
        b.device.legs = begin + 0.02 * np.sin(0.05 * k)
        b.tick(*(["reset"] if k == 60 else []))
    assert b.state == "FAULT"
    frames = len(b.sent)
    assert b.until("PARKING", 1.0) == pytest.approx(0.3, abs=0.06)
    b.until("PARKED", 40.0)
    assert np.abs(b.sent[frames + 1].legs - begin).max() < 0.03
    legal(b)


def test_who_begins_beside_a_device_that_moves_waits_until_it_stands():
    b = Bench(compact())
    b.device.put_up(np.array([0.03, 0.0, 0.02, 0.0, 0.0, 0.0]))
    begin = np.array(b.device.legs)
    for k in range(240):
        b.device.legs = begin + 0.01 * np.sin(0.1 * k)
        b.tick()
    assert b.state == "OFFLINE"
    stood = np.array(b.device.legs)
    b.until("PARKING", 0.5)
    b.run(0.02)
    first = next(s for s in b.sent if s.order is Order.FOLLOW)
    assert np.abs(first.legs - stood).max() < 2e-3
    b.until("PARKED", 20.0)
    legal(b)
