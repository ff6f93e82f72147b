"""Restarts while raised, dry runs and gaps of the guard's own loop, on virtual time."""

from dataclasses import replace

import numpy as np
import pytest
from device_model import TICK_NS
from guard_scenes import away, bench, die, legal
from own_kinematics import lengths

from motionserver.core.axes import frozen
from motionserver.core.device import Order, Phase
from motionserver.core.safety.accept import accept_rest
from motionserver.core.safety.own_moves import REACH
from motionserver.core.safety.states import RAISED, State
from motionserver.core.safety.verdict import Reason


@pytest.mark.parametrize(
    "pose",
    [
        (0.05, 0.03, 0.02, 0.05, -0.04, 0.1),
        (0.0, 0.0, -0.16, 0.0, 0.0, 0.0),
        (-0.1, 0.1, 0.0, 0.0, 0.1, -0.1),
    ],
)
@pytest.mark.parametrize("as_pose", [False, True])
def test_a_restart_while_raised_begins_where_it_stands(pose, as_pose):
    b = bench()
    b.device.put_up(np.array(pose))
    if as_pose:
        whole = b.device.answer
        b.device.answer = lambda now: replace(whole(now), legs=None, pose=np.array(pose))
    b.until("PARKING", 1.0)
    b.run(0.1)
    first = next(s for s in b.sent if s.order is Order.FOLLOW)
    assert first.legs == pytest.approx(lengths(b.machine, np.array(pose))[0], abs=1e-8)
    if not as_pose:
        b.until("PARKED", 30.0)
        legal(b)


def test_a_restart_a_hair_outside_is_drawn_inside():
    b = bench()
    pose = np.array([0.0, 0.0, 0.1999, 0.0, 0.0, 0.0])
    b.device.put_up(pose)
    b.until("PARKING", 1.0)
    b.run(0.1)
    first = next(s for s in b.sent if s.order is Order.FOLLOW)
    off = np.abs(first.legs - lengths(b.machine, pose)[0]).max()
    assert 0.0 < off < 0.005
    b.until("PARKED", 30.0)
    legal(b)


FAR = (0.1975, -0.0177, 0.0, -0.0065, -0.0249, -0.0085)
"""Straight to neutral, but through the end of the stroke on the straight way to where it parks."""


def far_up():
    b = bench()
    homes = b.guard.homes
    pose = frozen(FAR)
    assert accept_rest(b.machine, pose, 1, homes, REACH).reason is Reason.NO_WAY_HOME
    b.device.put_up(pose)
    return b


def test_a_restart_far_out_goes_home_over_neutral():
    b = far_up()
    b.until("PARKING", 1.0)
    b.until("PARKED", 30.0)
    assert "FAULT" not in b.seen
    first = next(s for s in b.sent if s.order is Order.FOLLOW)
    assert first.legs == pytest.approx(lengths(b.machine, np.array(FAR))[0], abs=1e-8)
    legal(b)


def test_a_successor_of_one_that_restarted_far_out_goes_on():
    b = far_up()
    b.until("PARKING", 1.0)
    assert die(b)
    b.until("PARKED", 30.0)
    legal(b)


def test_a_dry_run_moves_nothing():
    b = bench(dry_run=True)
    b.until("PARKED", 1.0)
    b.tick()
    b.tick("engage")
    b.until("RUN", 3.0)
    b.run(2.0)
    assert b.state == "RUN"
    assert {s.order for s in b.sent} == {Order.WAIT}
    assert b.device.phase is Phase.DOWN
    b.tick("park")
    b.until("PARKED", 20.0)


def test_a_short_gap_of_the_loop_is_only_an_event():
    b = bench().engaged()
    away(b)
    clock = b.record.playback.clock
    b.source = True
    b.tick(gap_ns=290_000_000)
    assert b.state == "RUN"
    assert b.record.playback.clock - clock < 0.1
    b.run(1.0)
    assert b.state == "RUN"


@pytest.mark.parametrize("gap", [0.15, 0.29])
def test_what_came_in_a_short_gap_of_the_computer_may_be_read_after_it(gap):
    b = bench().engaged()
    b.source = False
    b.tick()
    b.tick(gap_ns=int(gap * 1e9))
    for _ in range(30):
        b.tick()
        assert b.state == "RUN"
    b.source = True
    b.run(1.0)
    assert b.seen[-1] == "RUN"


def test_a_source_that_stays_away_after_a_gap_is_stale_in_time_and_excused_once():
    b = bench().engaged()
    b.source = False
    b.run(0.1)
    b.tick(gap_ns=90_000_000)
    b.run(0.1)
    assert b.state == "RUN", "190 ms of silence, of which 90 were ours"
    b.tick(gap_ns=90_000_000)
    assert b.state == "HOLD"
    assert "stale" in b.record.reason


def test_a_source_that_was_silent_before_the_gap_is_not_excused():
    b = bench().engaged()
    b.source = False
    b.run(0.2)
    assert b.state == "HOLD"
    silent = b.guard.supervisor.source.silent_for(b.now)
    b.tick(gap_ns=90_000_000)
    assert b.guard.supervisor.source.silent_for(b.now) == pytest.approx(silent + 0.09)


@pytest.mark.parametrize("gap", [0.31, 5.0])
def test_a_long_gap_of_the_loop_holds(gap):
    b = bench().engaged()
    away(b)
    b.tick(gap_ns=int(gap * 1e9))
    assert b.state == "HOLD"
    assert "loop" in b.record.reason
    b.until("RUN", 2.0)
    legal(b)


def test_gaps_do_not_excuse_a_silent_device():
    b = bench().engaged()
    b.device.silent = True
    for _ in range(20):
        b.tick(gap_ns=60_000_000)
    assert b.state == "FAULT"


def test_states_and_counters_are_told():
    b = bench().engaged()
    record = b.record
    assert record.counters["entered_run"] == 1
    assert record.since_ns <= b.now
    assert [text.split(":")[0] for _, text in record.events][-1] == "READY -> RUN"
    assert State(b.state) in RAISED
    assert record.counters["setpoints"] == len(b.sent)
    assert pytest.approx(1e9, rel=1e-6) == TICK_NS * 240


def test_a_long_gap_while_ready_holds_and_parks_without_a_source():
    b = bench()
    b.engaged("READY")
    b.source = False
    b.tick(gap_ns=310_000_000)
    assert b.state == "HOLD"
    b.until("PARKING", 2.5)
    b.until("PARKED", 20.0)
