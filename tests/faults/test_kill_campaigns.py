"""SIGKILL of each process at a hundred random moments (FAULT_ROUNDS), judged by the base alone."""

import json
import math
import os
import re
import signal
import sys
import time
from pathlib import Path
from random import Random
from typing import Any

import pytest
from far_ends import FarRig
from process_hands import is_loaded, kill, replaced, rounds
from rig import assert_soft, until
from setpoint_log import (
    ACCELERATION,
    STEP,
    assert_apart,
    crossing,
    largest_step,
    pauses,
    spacings,
    spread,
    stretches,
    wall_speeds,
)

pytestmark = [pytest.mark.campaign, pytest.mark.timeout(7200)]
SEED = 2014


def tell(name: str, **figures: Any) -> None:
    sys.stdout.write(f"\n{name}: {json.dumps(figures, indent=2)}\n")
    sys.stdout.flush()


def one_kill(rig: FarRig, name: str, random: Random) -> dict[str, float]:
    """Kill it at a random moment of a drive; how it went on."""
    rig.drives_again()
    rig.wait_for(lambda: is_loaded(rig.pid("spare")), "the spare to be loaded")
    # a guard that took over just before does not pass its state on
    time.sleep(random.uniform(1.5, 4.0))
    began = time.monotonic_ns()
    old = kill(rig, name)
    figure: dict[str, float] = {"at_ns": began}
    if name == "planner":
        rig.wait_state("PARKED")
        figure["parked_s"] = 1e-9 * (time.monotonic_ns() - began)
        replaced(rig, name, old)
        rig.wait_for(lambda: rig.shown(name).get("pid") not in (None, old), "the planner's word")
    else:
        replaced(rig, "spare" if name == "guard" else name, old)
    if name == "guard":
        rig.wait_for(lambda: is_loaded(rig.pid("spare")), "the next spare to be loaded")
    figure["back_s"] = 1e-9 * (time.monotonic_ns() - began)
    if name != "planner":
        # a machine that stalls altogether for 0.1 s is a fault of the base to the server
        rig.drives_again()
        rig.wait_plans(10)
    return figure


@pytest.mark.parametrize("name", ["guard", "web", "planner"])
def test_kills(tmp_path: Path, name: str) -> None:
    random, figures = Random(SEED), []
    with FarRig(tmp_path, web=name == "web") as rig:
        rig.drive()
        for number in range(rounds(100)):
            figures.append(one_kill(rig, name, random))
            print(number, name, figures[-1], flush=True)
        takeovers, way, text = rig.counter("takeovers", "guard"), rig.transitions(), rig.text()
        assert rig.end() == 0
        verdict = rig.verdict()
    log = tmp_path / "base.log"
    told: dict[str, Any] = {"kills": len(figures), "violations": verdict["violations"]}
    for key in figures[0].keys() - {"at_ns"}:
        told[key] = spread([figure[key] for figure in figures])
    for key in ("speed_max", "acceleration_max", "jerk_max", "gap_ms"):
        told[key] = verdict[key]
    told["step_mm"] = 1e3 * largest_step(log)
    told["pauses"] = spread(pauses(log))
    told["spacing_min"], told["wall_speed_max"] = spacings(log)[0], wall_speeds(log)[-1]
    told["faults"] = re.findall(r"-> FAULT: (.*)", text)
    told["holds"] = way.count(("RUN", "HOLD"))
    crossings = []
    if name == "guard":
        every = stretches(log)
        crossings = [crossing(every, int(figure["at_ns"])) for figure in figures]
        for key in ("pause", "speed", "acceleration", "jerk", "periods"):
            told[f"over_the_kill_{key}"] = spread([getattr(one, key) for one in crossings])
        told["pauses_over_2.5"] = sum(one.pause > 2.5 for one in crossings)
        told["anew"] = text.count("begins anew")
    tell(name, **told)
    assert_soft(verdict)
    assert verdict["is_parked"]
    assert largest_step(log) < STEP
    assert_apart(log)
    if name == "planner":
        assert way.count(("PARKING", "PARKED")) >= len(figures)
    else:
        # one drive from the first packet to the last: only a fault of the base parts it
        assert way.count(("PARKED", "RAISING")) == 1 + len(told["faults"])
    if name == "guard":
        assert takeovers == len(figures)
        assert not told["anew"]
        # in the order of the packets a kill is invisible: one period of motion lies over it
        assert max(one.acceleration for one in crossings) <= ACCELERATION
        assert all(0.5 < one.periods < 1.5 for one in crossings if not math.isnan(one.periods))


def test_supervisor_kills(tmp_path: Path) -> None:
    random, figures = Random(SEED), []
    for number in range(rounds(100)):
        folder = tmp_path / str(number)
        folder.mkdir()
        with FarRig(folder, web=number % 2 == 0) as rig:
            rig.run()
            time.sleep(random.uniform(0.0, 3.0))
            began = time.monotonic()
            os.kill(rig.server.pid, signal.SIGKILL)
            rig.server.wait(10.0)
            until(lambda: not rig.leftovers(), "all children to end")
            took = time.monotonic() - began
            way, verdict = rig.transitions(), rig.verdict()
        assert way[-2:] in (
            [("RUN", "PARKING"), ("PARKING", "PARKED")],
            [("HOLD", "PARKING"), ("PARKING", "PARKED")],
        )
        assert_soft(verdict)
        assert verdict["is_parked"]
        step = largest_step(folder / "base.log")
        assert step < STEP
        assert_apart(folder / "base.log")
        one = {"ended_s": took, "acceleration": verdict["acceleration_max"], "step_mm": 1e3 * step}
        one |= {"gap_ms": verdict["gap_ms"]["max"], "speed": verdict["speed_max"]}
        figures.append(one)
        print(number, "supervisor", one, flush=True)
    told = {key: spread([figure[key] for figure in figures]) for key in figures[0]}
    tell("supervisor", kills=len(figures), violations=0, **told)
