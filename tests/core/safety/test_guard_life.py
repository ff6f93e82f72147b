"""The guard's life on virtual time: up, run, hold, park; who may engage; when it comes down."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from device_model import TICK_NS, Bench
from machines import compact
from own_kinematics import lengths, worst

from motionserver.core.device import Order, Phase
from motionserver.core.motion.moves import rest_to_rest
from motionserver.core.safety.states import RAISED, State
from motionserver.core.safety.watchdog import Patience
from motionserver.core.state import DriveMode


def bench(**config):
    return Bench(compact(), **config)


def away(b, goal=(0.05, 0.02, -0.04, 0.05, 0.04, -0.06), duration=2.0):
    """Let the planner go to a pose and stay there."""
    mine = []

    def plan(playback):
        newest = playback.newest.plan
        if newest.plan_id in mine:
            b.plan = b._remainder
            return b.plan(playback)
        mine.append(b.number())
        takeover = max(playback.newest_clock, newest.duration) + 0.02
        return rest_to_rest(
            mine[-1], newest.plan_id, takeover, newest.rest_pose, np.array(goal), duration
        )

    b.plan = plan
    b.run(duration + 0.3)
    return np.array(goal)


def legal(b):
    """Every emitted setpoint lies inside the limits, by other kinematics."""
    for order, run in itertools.groupby(b.sent, lambda setpoint: setpoint.order):
        sent = list(run)
        poses = np.array([s.state.pose for s in sent])
        legs = np.array([s.legs for s in sent])
        assert legs == pytest.approx(lengths(b.machine, poses), abs=1e-12)
        if order is Order.FOLLOW:
            assert max(worst(b.machine, poses, 1 / 60).values()) <= 1.0


def test_the_whole_life():
    b = bench().engaged()
    assert b.seen == ["OFFLINE", "PARKED", "RAISING", "READY", "RUN"]
    goal = away(b)
    assert b.sent[-1].state.pose == pytest.approx(goal, abs=1e-9)
    b.tick("park", by="http")
    took = b.until("PARKED", 30.0)
    assert 1.0 < took < 12.0
    assert b.seen[5:] == ["PARKING", "PARKED"]
    assert b.device.phase is Phase.DOWN
    assert {s.order for s in b.sent} == {Order.WAIT, Order.RAISE, Order.FOLLOW, Order.PARK}
    legal(b)


def test_before_feedback_it_only_says_the_mode_word():
    b = bench()
    b.device.silent = True
    b.run(2.0)
    assert b.state == "OFFLINE"
    assert {s.order for s in b.sent} == {Order.WAIT}
    b.device.silent = False
    assert b.until("PARKED", 1.0) >= 0.3


def test_engaging_needs_parked_and_a_fresh_source():
    b = bench()
    assert "state is OFFLINE" in b.tick("engage")[0]
    b.source = False
    b.until("PARKED", 1.0)
    b.run(0.2)
    assert "no fresh source" in b.tick("engage")[0]
    b.source = True
    assert "engaging by http is off" in b.tick("engage", by="http")[0]
    assert b.state == "PARKED"
    b.tick()
    assert "unknown request" in b.tick("dance")[0]
    assert b.tick("engage") == ("",)
    assert b.state == "RAISING"
    assert "state is RAISING" in b.tick("engage")[0]
    assert b.record.counters["request_refused"] == 5


def test_engaging_needs_a_device_that_is_down():
    b = bench()
    b.until("PARKED", 1.0)
    b.device.phase = Phase.STARTING
    b.run(0.1)
    assert b.state == "PARKED"
    assert "down and ready" in b.tick("engage")[0]


def test_nobody_engages_while_it_ends():
    b = bench()
    b.until("PARKED", 1.0)
    b.tick(leave=True)
    assert "ending" in b.tick("engage")[0]


def test_http_engages_when_told_so():
    b = bench(engage="http")
    b.until("PARKED", 1.0)
    b.tick()
    assert b.tick("engage", by="http") == ("",)
    b.until("RUN", 3.0)


def test_auto_engages_once_only():
    b = bench(engage="auto")
    b.source = False
    b.until("PARKED", 1.0)
    b.run(1.0)
    assert b.state == "PARKED"
    b.source = True
    b.until("RUN", 5.0)
    b.tick("park")
    b.until("PARKED", 30.0)
    b.run(5.0)
    assert b.state == "PARKED"
    assert "engaging by http is off" in b.tick("engage", by="http")[0]
    b.tick("engage")
    assert b.state == "RAISING"


def test_raising_gives_up_after_twenty_seconds():
    b = bench()
    b.until("PARKED", 1.0)
    b.tick()
    b.device.stuck = True
    b.tick("engage")
    assert b.until("PARKING", 21.0) == pytest.approx(20.0, abs=0.01)
    b.device.stuck = False
    b.device.phase = Phase.UP
    b.until("PARKED", 3.0)


def test_it_runs_only_when_plans_are_accepted():
    b = bench()
    b.planning = False
    b.engaged("READY")
    b.run(3.0)
    assert b.state == "READY"
    b.planning = True
    assert b.until("RUN", 1.0) < 0.1


def test_it_runs_only_after_half_a_second_of_driving():
    b = bench()
    b.mode = DriveMode.PAUSE
    b.engaged("READY")
    b.run(2.0)
    assert b.state == "READY"
    b.mode = DriveMode.DRIVE
    assert b.until("RUN", 1.0) == pytest.approx(0.5, abs=0.02)


def test_ready_parks_after_thirty_seconds_of_silence():
    b = bench()
    b.mode = DriveMode.PAUSE
    b.engaged("READY")
    b.source = False
    assert b.until("PARKING", 31.0) == pytest.approx(30.15, abs=0.05)


def test_a_stale_source_holds_and_then_parks():
    b = bench().engaged()
    away(b)
    b.source = False
    assert b.until("HOLD", 1.0) == pytest.approx(0.15, abs=0.02)
    assert "stale" in b.record.reason
    assert b.until("PARKING", 3.0) == pytest.approx(2.0, abs=0.02)
    b.until("PARKED", 30.0)
    legal(b)


def test_a_source_that_comes_back_runs_again():
    b = bench().engaged()
    b.source = False
    b.until("HOLD", 1.0)
    b.run(1.0)
    b.source = True
    assert b.until("RUN", 1.0) == pytest.approx(0.5, abs=0.02)


def test_no_plans_hold():
    b = bench().engaged()
    b.planning = False
    assert b.until("HOLD", 1.0) == pytest.approx(3 * 0.0125, abs=0.03)
    assert "no plan" in b.record.reason
    assert b.until("PARKING", 3.0) == pytest.approx(2.0, abs=0.02)


def test_a_planner_that_talks_nonsense_holds():
    b = bench().engaged()
    good = b.plan
    b.plan = lambda playback: replace(good(playback), parent_id=12345)
    b.until("HOLD", 1.0)
    assert b.record.counters["rejected_wrong-parent"] > 0
    assert b.record.rejections[-1][1].reason == "wrong-parent"


@pytest.mark.parametrize("seconds", [3.0, 11.5])
def test_a_pause_may_last_and_then_it_runs_on(seconds):
    b = bench(patience=Patience(pause=12.0)).engaged()
    b.mode = DriveMode.PAUSE
    b.until("HOLD", 0.1)
    assert "pauses" in b.record.reason
    b.run(seconds)
    assert b.state == "HOLD"
    b.mode = DriveMode.DRIVE
    assert b.until("RUN", 1.0) == pytest.approx(0.5, abs=0.02)


def test_a_pause_ends():
    assert Patience().pause == 600.0
    b = bench(patience=Patience(pause=5.0)).engaged()
    b.mode = DriveMode.PAUSE
    b.until("HOLD", 0.1)
    assert b.until("PARKING", 6.0) == pytest.approx(5.0, abs=0.02)


def test_a_pause_that_falls_silent_is_a_hold():
    b = bench().engaged()
    b.mode = DriveMode.PAUSE
    b.until("HOLD", 0.1)
    b.run(4.0)
    b.source = False
    assert b.until("PARKING", 5.0) == pytest.approx(2.15, abs=0.03)


def test_a_bye_parks_at_once():
    b = bench().engaged()
    b.mode = DriveMode.BYE
    b.tick()
    assert b.state == "PARKING"


@pytest.mark.parametrize("state", ["RAISING", "READY", "RUN", "HOLD"])
def test_leaving_parks_from_everywhere(state):
    b = bench()
    b.mode = DriveMode.PAUSE if state in ("READY", "RAISING") else DriveMode.DRIVE
    b.engaged("RUN" if state == "HOLD" else state)
    if state == "HOLD":
        b.mode = DriveMode.PAUSE
        b.until("HOLD", 0.1)
    b.tick(leave=True)
    assert b.state == "PARKING"
    b.until("PARKED", 20.0)
    b.run(1.0)
    assert b.state == "PARKED"


def test_plans_are_for_cued_states_only():
    b = bench().engaged()
    away(b)
    b.tick("park")
    before = b.record.counters["plans_accepted"]
    b.run(1.0)
    assert b.state == "PARKING"
    assert b.record.counters["plans_accepted"] == before
    assert b.record.counters["rejected_not-cueing"] > 0


def test_the_planner_may_run_ahead_but_not_far():
    b = bench().engaged()

    def ahead(playback):
        plan = b._remainder(playback)
        return replace(plan, takeover=max(playback.newest_clock, 0.01) + 0.1)

    b.plan, b.plan_every = ahead, 1
    b.run(0.1)
    assert len(b.record.playback.pending) == 3
    assert b.record.counters["rejected_wrong-parent"] > 0
    far = b._remainder
    b.plan = lambda playback: replace(far(playback), takeover=1e6)
    b.run(0.5)
    assert b.record.counters["rejected_too-early"] > 0
    b.tick("park")
    b.until("PARKED", 20.0)


def test_parking_that_takes_too_long_is_a_fault():
    b = bench().engaged()
    b.device.stuck = True
    b.tick("park")
    assert b.until("FAULT", 60.0) > 15.0
    assert "parking took twice" in b.record.reason


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
