"""SIGSTOP of each process in motion: one after the other here, twenty of each as a campaign."""

import json
import os
import signal
import sys
import time
import urllib.error
import urllib.request
from collections import Counter
from pathlib import Path
from random import Random
from typing import Any

import pytest
from far_ends import FarRig
from process_hands import freeze, is_loaded, replaced, rounds
from rig import assert_soft, is_alive
from setpoint_log import ACCELERATION, STEP, assert_apart, crossing, largest_step, spread, stretches

KILL = "stands still; killed"
CHILDREN = ("guard", "spare", "planner", "web")
HICCUP = {("RUN", "HOLD"), ("HOLD", "RUN")}
"""A busy machine may hold for a moment; that is no failure of anything."""
KEPT = 1.0
"""A planner that stands for so long costs a hold and no more [s]: fresh for 0.5 s within 2 s."""
PARKS = 2.5
"""One that stands for so long parks the platform [s]."""
KILLED = 1.0
"""A guard that stands for so long is killed [s], even by a supervisor that is looked at askance."""


def serve(rig: FarRig) -> int:
    """Status of the page's answer."""
    with urllib.request.urlopen(f"http://127.0.0.1:{rig.page_port}/", timeout=30.0) as answer:
        return int(answer.status)


def is_served(rig: FarRig) -> bool:
    """Whether there is a page that answers."""
    try:
        return serve(rig) == 200
    except urllib.error.URLError:
        return False


def ready(rig: FarRig, random: Random, wait: tuple[float, float]) -> None:
    """In motion, at a random moment."""
    if rig.state != "RUN":
        rig.engage()
        rig.wait_state("RUN")
    rig.wait_for(rig.is_moving, "motion")
    rig.wait_for(lambda: is_loaded(rig.pid("spare")), "the spare to be loaded")
    # a guard that took over just before does not pass its state on
    time.sleep(random.uniform(*wait))


def stop_guard(rig: FarRig, seconds: float) -> str:
    """The supervisor kills it, and the spare goes on with the same drive."""
    old, spare = rig.pid("guard"), rig.pid("spare")
    before, told = rig.counter("takeovers", "guard"), rig.text().count(KILL)
    assert old is not None
    freeze(old, seconds)
    if is_alive(old) and rig.text().count(KILL) == told:
        assert seconds < KILLED, "a guard that stood still was left alone"
        return "woke"
    rig.wait_for(lambda: not is_alive(old), "the guard to be gone")
    rig.wait_for(lambda: rig.shown().get("pid") == spare, "the spare's word")
    assert rig.counter("takeovers", "guard") == before + 1
    assert rig.text().count(KILL) == told + 1
    return "killed"


def stop_planner(rig: FarRig, seconds: float) -> str:
    """Its plan plays to rest; it is not replaced so soon, and it drives again."""
    old = rig.pid("planner")
    assert old is not None
    freeze(old, seconds)
    rig.wait_state("RUN", "PARKED")
    assert rig.pid("planner") == old
    return "woke"


def stop_web(rig: FarRig, seconds: float) -> str:
    old = rig.pid("web")
    assert old is not None
    freeze(old, seconds)
    assert serve(rig) == 200
    assert rig.pid("web") == old
    return "woke"


def stop_supervisor(rig: FarRig, seconds: float) -> str:
    """Nobody is killed by a supervisor that wakes up: it stood itself."""
    pids, told = [rig.pid(name) for name in CHILDREN], rig.text().count(KILL)
    freeze(rig.server.pid, seconds)
    rig.wait_plans(20)
    time.sleep(0.3)
    assert [rig.pid(name) for name in CHILDREN] == pids
    assert rig.text().count(KILL) == told
    return "woke"


STOPS = {
    "guard": stop_guard,
    "planner": stop_planner,
    "web": stop_web,
    "supervisor": stop_supervisor,
}


def one_stop(rig: FarRig, name: str, seconds: float) -> dict[str, Any]:
    """Stop a process for so long; how it went on."""
    before = len(rig.transitions())
    began = time.monotonic_ns()
    figure = {"at_ns": began, "seconds": seconds, "outcome": STOPS[name](rig, seconds)}
    way = rig.transitions()[before:]
    if name == "planner" and (parked := ("PARKING", "PARKED") in way):
        figure["outcome"] = "parked"
    if name == "planner":
        assert not parked or seconds > KEPT, (seconds, way)
        assert parked or seconds < PARKS, (seconds, way)
    if figure["outcome"] != "parked":
        rig.wait_state("RUN")
        rig.wait_plans(10)
        way = rig.transitions()[before:]
        assert set(way) <= HICCUP, (name, seconds, way)
    return {**figure, "holds": way.count(("RUN", "HOLD"))}


def test_whoever_stands_still_for_a_moment_moves_nothing(tmp_path: Path) -> None:
    random = Random(7)
    with FarRig(tmp_path, web=True) as rig:
        rig.run()
        rig.wait_for(lambda: rig.pid("web"), "the page")
        for name, seconds in (("web", 0.6), ("supervisor", 0.6), ("planner", 0.4)):
            ready(rig, random, (0.0, 0.3))
            figure = one_stop(rig, name, seconds)
            assert figure["outcome"] == "woke"
        assert figure["holds"] >= 1
        assert rig.end() == 0
        verdict = rig.verdict()
    assert_soft(verdict)
    assert largest_step(tmp_path / "base.log") < STEP
    assert_apart(tmp_path / "base.log")


@pytest.mark.campaign
def test_planner_and_page_that_stand_still_for_good_are_replaced(tmp_path: Path) -> None:
    with FarRig(tmp_path, web=True) as rig:
        rig.run()
        rig.wait_for(lambda: rig.pid("web"), "the page")
        rig.wait_for(lambda: is_served(rig), "the page's answer")
        old = {name: rig.pid(name) for name in ("planner", "web")}
        for pid in old.values():
            assert pid is not None
            os.kill(pid, signal.SIGSTOP)
        rig.wait_state("PARKED")
        for name, pid in old.items():
            assert pid is not None
            replaced(rig, name, pid)
        assert rig.text().count("stands still; killed, another is started") == 2
        rig.wait_for(lambda: is_served(rig), "the page's answer")
        rig.engage()
        rig.wait_state("RUN")
        rig.wait_plans(10)
        assert rig.end() == 0
        verdict = rig.verdict()
    assert_soft(verdict)


@pytest.mark.campaign
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("name", list(STOPS))
def test_a_process_stands_still_again_and_again(tmp_path: Path, name: str) -> None:
    random, figures = Random(1966), []
    with FarRig(tmp_path, web=True) as rig:
        rig.run()
        rig.wait_for(lambda: rig.pid("web"), "the page")
        for number in range(rounds(20)):
            ready(rig, random, (1.2, 2.5))
            figures.append(one_stop(rig, name, 0.1 * 50.0 ** random.random()))
            print(number, name, figures[-1], flush=True)
        assert rig.end() == 0
        verdict = rig.verdict()
    every = stretches(tmp_path / "base.log")
    told: dict[str, Any] = {
        "stops": len(figures),
        "violations": verdict["violations"],
        "outcomes": Counter(figure["outcome"] for figure in figures),
        "seconds": spread([figure["seconds"] for figure in figures]),
        "holds": sum(figure["holds"] for figure in figures),
        **{key: verdict[key] for key in ("speed_max", "acceleration_max", "jerk_max", "gap_ms")},
        "step_mm": 1e3 * largest_step(tmp_path / "base.log"),
    }
    crossings = [crossing(every, int(figure["at_ns"])) for figure in figures]
    if name == "guard":
        for key in ("pause", "speed", "acceleration", "jerk", "periods"):
            told[f"over_the_stop_{key}"] = spread([getattr(one, key) for one in crossings])
    sys.stdout.write(f"\n{name}: {json.dumps(told, indent=2)}\n")
    assert_soft(verdict)
    assert verdict["is_parked"]
    assert largest_step(tmp_path / "base.log") < STEP
    assert_apart(tmp_path / "base.log")
    assert max(one.acceleration for one in crossings) <= ACCELERATION
