"""SIGKILL of each process in motion, once; `test_kill_campaigns` does it a hundred times."""

import os
import signal
from pathlib import Path

import pytest
from process_hands import kill, replaced
from rig import Rig, assert_soft, is_alive, until
from setpoint_log import STEP, assert_apart, largest_step

BACK_TO_PARKED = ("PARKING", "PARKED")


def kill_planner(rig: Rig) -> None:
    old = kill(rig, "planner")
    rig.wait_state("PARKED")
    # another process may have been parked by before: what counts is that it parked after this
    replaced(rig, "planner", old)
    rig.wait_for(lambda: rig.shown("planner").get("pid") not in (None, old), "the planner's word")


def test_page_and_planner_are_killed_in_motion(tmp_path: Path) -> None:
    with Rig(tmp_path, web=True) as rig:
        rig.run()
        rig.wait_for(lambda: rig.pid("web"), "the page")
        before = rig.way()
        replaced(rig, "web", kill(rig, "web"))
        rig.wait_plans(30)
        rig.wait_state("RUN")
        assert rig.way() == before
        kill_planner(rig)
        way = rig.transitions()
        assert ("RUN", "HOLD") in way
        assert way[-3:] == [("RUN", "HOLD"), ("HOLD", "PARKING"), BACK_TO_PARKED]
        # the new planner drives as well as the old one
        rig.engage()
        rig.wait_state("RUN")
        rig.wait_plans(20)
        assert rig.end() == 0
        verdict = rig.verdict()
    assert_soft(verdict)


def takes_over(rig: Rig, number: signal.Signals) -> None:
    """End the guard in motion; the spare goes on with the same drive."""
    rig.run()
    way, (old, spare) = rig.way(), (rig.pid("guard"), rig.pid("spare"))
    before = rig.counter("takeovers", "guard")
    assert old is not None
    os.kill(old, number)
    rig.wait_for(lambda: not is_alive(old), "the guard to be gone")
    rig.wait_for(lambda: rig.shown().get("pid") == spare, "the spare's word")
    assert rig.counter("takeovers", "guard") == before + 1
    rig.wait_plans(30)
    # nothing parks and nothing begins anew
    rig.wait_state("RUN")
    assert rig.way() == way
    replaced(rig, "spare", old)


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_the_spare_goes_on_with_the_same_drive(tmp_path: Path, number: signal.Signals) -> None:
    with Rig(tmp_path) as rig:
        takes_over(rig, number)
        if number is signal.SIGSTOP:
            assert "stands still; killed" in rig.text()
        assert rig.end() == 0
        verdict = rig.verdict()
    assert_soft(verdict)
    assert verdict["is_parked"]
    assert largest_step(tmp_path / "base.log") < STEP
    assert_apart(tmp_path / "base.log")


def test_a_killed_supervisor_leaves_a_guard_that_parks_and_ends(tmp_path: Path) -> None:
    with Rig(tmp_path, web=True) as rig:
        rig.run()
        rig.wait_for(lambda: rig.pid("web"), "the page")
        assert len(rig.leftovers()) >= 4
        os.kill(rig.server.pid, signal.SIGKILL)
        rig.server.wait(10.0)
        until(lambda: not rig.leftovers(), "all children to end")
        assert rig.way()[4:] == [("RUN", "PARKING"), BACK_TO_PARKED]
        verdict = rig.verdict()
    assert_soft(verdict)
    assert verdict["is_parked"]


def test_a_guard_killed_while_the_server_ends_has_a_successor_that_parks(tmp_path: Path) -> None:
    with Rig(tmp_path) as rig:
        rig.run()
        rig.send_signal(signal.SIGTERM)
        rig.wait_state("PARKING")
        pid = rig.shown()["pid"]
        # a second signal of either kind hurries nothing
        rig.send_signal(signal.SIGTERM)
        rig.send_signal(signal.SIGINT)
        os.kill(pid, signal.SIGKILL)
        assert rig.end() == 0
        assert rig.transitions()[-1][1] == "PARKED"
        verdict = rig.verdict()
    # the base may have waited too long for the successor to start: then it parked by itself
    assert verdict["violations"] == 0
    assert verdict["ended_safe"]
