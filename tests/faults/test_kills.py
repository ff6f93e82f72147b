"""SIGKILL of each process in motion: short versions here, twenty of each as a campaign."""

import json
import os
import signal
import struct
import sys
import time
from pathlib import Path
from random import Random
from typing import Any

import pytest
from motion_clients.moog_wire import Mcw
from motion_clients.motion_log import read_motion_log
from rig import Rig, assert_soft, is_alive, until

BACK_TO_PARKED = ("PARKING", "PARKED")


def kill(rig: Rig, name: str) -> int:
    """Kill a process by the supervisor's word; its id."""
    pid = rig.pid(name)
    assert pid is not None
    os.kill(pid, signal.SIGKILL)
    rig.wait_for(lambda: not is_alive(pid), f"the {name} to be gone")
    return pid


def replaced(rig: Rig, name: str, old: int) -> None:
    rig.wait_for(lambda: rig.pid(name) not in (None, old), f"another {name}")


def kill_planner(rig: Rig) -> None:
    old = kill(rig, "planner")
    rig.wait_state("PARKED")
    # another process may have been parked by before: what counts is that it parked after this
    replaced(rig, "planner", old)
    rig.wait_for(lambda: rig.shown("planner").get("pid") not in (None, old), "the planner's word")


def jump_after_takeover(log: Path) -> float:
    """Largest difference of a word between the last setpoint of one guard and the next's first."""
    largest, last, gap = 0.0, None, False
    for _, data in read_motion_log(log):
        mcw, *words = struct.unpack(">I6fI", data)
        if mcw & 0xFF != Mcw.NEW_POSITION:
            gap = mcw & 0xFF == Mcw.LENGTH_MODE
            continue
        if gap and last is not None:
            largest = max(largest, *(abs(a - b) for a, b in zip(words[:6], last, strict=True)))
        last, gap = words[:6], False
    return largest


def test_page_and_planner_are_killed_in_motion(tmp_path: Path) -> None:
    with Rig(tmp_path, web=True) as rig:
        rig.run()
        rig.wait_for(lambda: rig.pid("web"), "the page")
        before = rig.shown()["counters"]["entered_run"]
        replaced(rig, "web", kill(rig, "web"))
        rig.wait_plans(30)
        assert rig.state == "RUN"
        assert rig.shown()["counters"]["entered_run"] == before
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


def test_the_spare_takes_over_from_a_killed_guard(tmp_path: Path) -> None:
    with Rig(tmp_path) as rig:
        rig.run()
        old, spare = kill(rig, "guard"), rig.pid("spare")
        rig.wait_for(lambda: rig.shown().get("pid") == spare, "the spare's word")
        rig.wait_state("PARKED")
        assert rig.transitions()[-2:] == [("OFFLINE", "PARKING"), BACK_TO_PARKED]
        replaced(rig, "spare", old)
        assert rig.end() == 0
        verdict = rig.verdict()
    assert_soft(verdict)
    assert verdict["is_parked"]
    assert jump_after_takeover(tmp_path / "base.log") < 1e-3


def test_a_frozen_guard_is_killed_and_the_spare_parks(tmp_path: Path) -> None:
    with Rig(tmp_path) as rig:
        rig.run()
        old, spare = rig.pid("guard"), rig.pid("spare")
        assert old is not None
        os.kill(old, signal.SIGSTOP)
        rig.wait_for(lambda: not is_alive(old), "the frozen guard to be killed")
        rig.wait_for(lambda: rig.shown().get("pid") == spare, "the spare's word")
        rig.wait_state("PARKED")
        assert "does not answer; killed" in rig.text()
        replaced(rig, "spare", old)
        assert rig.end() == 0
        verdict = rig.verdict()
    assert_soft(verdict)
    assert verdict["is_parked"]
    assert jump_after_takeover(tmp_path / "base.log") < 1e-3


def test_a_killed_supervisor_leaves_a_guard_that_parks_and_ends(tmp_path: Path) -> None:
    with Rig(tmp_path, web=True) as rig:
        rig.run()
        rig.wait_for(lambda: rig.pid("web"), "the page")
        assert len(rig.leftovers()) >= 4
        os.kill(rig.server.pid, signal.SIGKILL)
        rig.server.wait(10.0)
        until(lambda: not rig.leftovers(), "all children to end")
        assert rig.transitions()[4:] == [("RUN", "PARKING"), BACK_TO_PARKED]
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


ROUNDS = 20


def campaign(rig: Rig, name: str, seed: int) -> list[dict[str, Any]]:
    random, figures = Random(seed), []
    rig.drive()
    for _ in range(ROUNDS):
        rig.engage()
        rig.wait_state("RUN")
        rig.wait_for(rig.is_moving, "motion")
        time.sleep(random.uniform(0.0, 3.0))
        speed = max(map(abs, rig.shown()["leg_speed"]))
        began = time.monotonic()
        old = kill(rig, name)
        if name == "web":
            replaced(rig, name, old)
            figures.append({"back_s": time.monotonic() - began, "speed": speed})
            assert rig.state == "RUN"
            rig.ask("park")
        rig.wait_state("PARKING", "PARKED")
        rig.wait_state("PARKED")
        parked = time.monotonic() - began
        if name != "web":
            replaced(rig, "spare" if name == "guard" else name, old)
            back = time.monotonic() - began
            figures.append({"parked_s": parked, "back_s": back, "speed": speed})
    return figures


@pytest.mark.campaign
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("name", ["planner", "web", "guard"])
def test_twenty_kills_in_motion(tmp_path: Path, name: str) -> None:
    with Rig(tmp_path, web=name == "web") as rig:
        figures = campaign(rig, name, seed=2014)
        assert rig.end() == 0
        verdict = rig.verdict()
    told = {"kills": len(figures), "violations": verdict["violations"]}
    for key in figures[0]:
        values = sorted(figure[key] for figure in figures)
        told[key] = {"median": values[len(values) // 2], "max": values[-1]}
    told |= {key: verdict[key] for key in ("speed_max", "acceleration_max", "gap_ms")}
    if name == "guard":
        told["jump_m"] = jump_after_takeover(tmp_path / "base.log")
    sys.stdout.write(f"\n{name}: {json.dumps(told, indent=2)}\n")
    assert_soft(verdict)
