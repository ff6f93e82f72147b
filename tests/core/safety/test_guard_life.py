"""The guard's life on virtual time: up, run, hold, park; who may engage; when it comes down."""

from dataclasses import replace

import pytest
from guard_scenes import away, bench, legal

from motionserver.core.device import Order, Phase
from motionserver.core.safety.watchdog import Patience
from motionserver.core.state import DriveMode


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
    b.enabled = False
    assert "the enable input is open" in b.tick("engage", by="http")[0]
    assert b.state == "PARKED"
    b.enabled = True
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


def test_ready_parks_after_long_silence():
    assert Patience().silence == 30.0
    b = bench(patience=Patience(silence=3.0))
    b.mode = DriveMode.PAUSE
    b.engaged("READY")
    b.source = False
    assert b.until("PARKING", 4.0) == pytest.approx(3.15, abs=0.05)


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
    assert b.record.counters["rejected_too-early"] > 0
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
