"""SIGKILL of each process in motion: short versions here, twenty of each as a campaign."""

import itertools
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


STEP = 1.05 * 0.5 / 60.0
"""A leg makes at most so much way from one packet to the next [m]: 0.5 m/s at 60 Hz."""


def largest_step(log: Path) -> float:
    """Largest difference of a word between two setpoints, whoever sent them."""
    largest, last = 0.0, None
    for _, data in read_motion_log(log):
        mcw, *words = struct.unpack(">I6fI", data)
        if mcw & 0xFF != Mcw.NEW_POSITION:
            continue
        if last is not None:
            largest = max(largest, *(abs(a - b) for a, b in zip(words[:6], last, strict=True)))
        last = words[:6]
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


def takes_over(rig: Rig, number: signal.Signals) -> None:
    """End the guard in motion; the spare goes on with the same drive."""
    rig.run()
    way, (old, spare) = rig.transitions(), (rig.pid("guard"), rig.pid("spare"))
    before = rig.counter("takeovers", "guard")
    assert old is not None
    os.kill(old, number)
    rig.wait_for(lambda: not is_alive(old), "the guard to be gone")
    rig.wait_for(lambda: rig.shown().get("pid") == spare, "the spare's word")
    assert rig.counter("takeovers", "guard") == before + 1
    rig.wait_plans(30)
    # a busy machine may hold for a moment; nothing parks and nothing begins anew
    later = rig.transitions()[len(way) :]
    assert set(later) <= {("RUN", "HOLD"), ("HOLD", "RUN")}
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


def is_loaded(pid: int | None) -> bool:
    """Whether a spare is through with its imports: the kernel lists it as waiting for the lock."""
    waiting = [line for line in Path("/proc/locks").read_text("ascii").splitlines() if "->" in line]
    return any(line.split()[5] == str(pid) for line in waiting)


def campaign(rig: Rig, name: str, seed: int) -> list[dict[str, Any]]:
    """Kill it again and again at random moments; only a planner's death parks the platform."""
    random, figures = Random(seed), []
    rig.drive()
    for _ in range(ROUNDS):
        if rig.state != "RUN":
            rig.engage()
            rig.wait_state("RUN")
        rig.wait_for(rig.is_moving, "motion")
        rig.wait_for(lambda: is_loaded(rig.pid("spare")), "the spare to be loaded")
        # a guard that took over just before does not pass its state on
        time.sleep(random.uniform(1.5, 4.0))
        speed = max(map(abs, rig.shown()["leg_speed"]))
        began = time.monotonic()
        old = kill(rig, name)
        figure = {"speed": speed}
        if name == "planner":
            rig.wait_state("PARKING", "PARKED")
            rig.wait_state("PARKED")
            figure["parked_s"] = time.monotonic() - began
        replaced(rig, "spare" if name == "guard" else name, old)
        figures.append({**figure, "back_s": time.monotonic() - began})
        if name != "planner":
            rig.wait_plans(10)
            assert rig.state == "RUN"
    return figures


def pauses(log: Path) -> list[int]:
    """Times between two setpoints, sorted [ns]."""
    instants = [
        when
        for when, data in read_motion_log(log)
        if struct.unpack_from(">I", data)[0] & 0xFF == Mcw.NEW_POSITION
    ]
    return sorted(after - before for before, after in itertools.pairwise(instants))


@pytest.mark.campaign
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("name", ["planner", "web", "guard"])
def test_twenty_kills_in_motion(tmp_path: Path, name: str) -> None:
    with Rig(tmp_path, web=name == "web") as rig:
        figures = campaign(rig, name, seed=2014)
        takeovers = rig.counter("takeovers", "guard")
        assert rig.end() == 0
        verdict = rig.verdict()
    told = {"kills": len(figures), "violations": verdict["violations"]}
    for key in figures[0]:
        values = sorted(figure[key] for figure in figures)
        told[key] = {"median": values[len(values) // 2], "max": values[-1]}
    told |= {key: verdict[key] for key in ("speed_max", "acceleration_max", "gap_ms")}
    if name == "guard":
        assert takeovers == ROUNDS
        told["step_m"] = largest_step(tmp_path / "base.log")
        told["longest_pauses_ms"] = [
            1e-6 * pause for pause in pauses(tmp_path / "base.log")[-ROUNDS:]
        ]
    sys.stdout.write(f"\n{name}: {json.dumps(told, indent=2)}\n")
    assert_soft(verdict)
    assert largest_step(tmp_path / "base.log") < STEP
