"""A cable is pulled in motion, at each end of each wire: network namespaces and real processes."""

import json
import math
import sys
import time
from collections import Counter
from itertools import pairwise
from pathlib import Path
from random import Random
from typing import Any

import pytest
from cabled import SIDES, CabledRig, Cables, why_not
from motion_clients.motion_log import read_motion_log
from process_hands import rounds
from rig import assert_soft
from setpoint_log import spread

WHY_NOT = why_not()
pytestmark = [
    pytest.mark.campaign,
    pytest.mark.timeout(3600),
    pytest.mark.skipif(bool(WHY_NOT), reason=f"no network namespaces: {WHY_NOT}"),
]
SPARED, LOST = 0.07, 0.15
"""A base that misses its packets for shorter is no fault, for longer is one [s]; the limit of its
answers is 0.1 s. A link needs a while to come up: what counts is what the base missed."""
STALE = 0.5
"""A simulator that was not heard for so long is held [s]; the limit is at most 0.3 s."""
PARKS = 3.0
"""One that was not heard for so long parks the platform [s]: held for 2 s."""


def one_pull(rig: CabledRig, side: str, seconds: float, random: Random) -> dict[str, Any]:
    """Pull one cable at a random moment of a drive; the states it cost, and how it drove again."""
    rig.drives_again()
    time.sleep(random.uniform(0.3, 1.5))
    before, began = len(rig.transitions()), time.monotonic_ns()
    rig.cables.pull(side, seconds)
    # what was seen late is waited for: a fault, or none, is certain a moment later
    time.sleep(0.5)
    rig.drives_again()
    rig.wait_plans(10)
    way = rig.transitions()[before:]
    took = 1e-9 * (time.monotonic_ns() - began) - seconds
    after = {state for _, state in way}
    if side == "simulator":
        assert not after & {"FAULT", "SAFE", "OFFLINE"}, (side, seconds, way)
        assert ("RUN", "HOLD") in way or seconds < STALE, (side, seconds, way)
        assert ("PARKING", "PARKED") in way or seconds < PARKS, (side, seconds, way)
    worst = next((s for s in ("SAFE", "FAULT", "PARKED", "HOLD") if s in after), "RUN")
    return {"at_ns": began, "side": side, "seconds": seconds, "worst": worst, "back_s": took}


def missed(log: Path, pull: dict[str, Any]) -> float:
    """How long the base got no packet about a pull [s]."""
    until = pull["at_ns"] + 1e9 * (pull["seconds"] + 2.0)
    at = [at for at, _ in read_motion_log(log) if pull["at_ns"] - 1e9 < at < until]
    return 1e-9 * max(after - before for before, after in pairwise(at))


def pulls(folder: Path, plan: list[tuple[str, float]], seed: int) -> dict[str, Any]:
    """Pull one after the other; what was seen. The base's word decides."""
    random, figures = Random(seed), []
    with Cables() as cables, CabledRig(cables, folder) as rig:
        rig.run()
        for number, (side, seconds) in enumerate(plan):
            figures.append(one_pull(rig, side, seconds, random))
            print(number, figures[-1], flush=True)
        assert set(rig.shown("service")["restarts"].values()) == {0}
        counters = rig.shown()["counters"]
        assert rig.end() == 0
        verdict = rig.verdict()
    for figure in figures:
        silent = figure["missed_s"] = missed(folder / "base.log", figure)
        if figure["side"] != "simulator":
            assert figure["worst"] == "FAULT" or silent < LOST, figure
            assert figure["worst"] != "FAULT" or silent > SPARED, figure
    told: dict[str, Any] = {
        "pulls": len(figures),
        "violations": verdict["violations"],
        "outcomes": {
            side: Counter(f["worst"] for f in figures if f["side"] == side) for side in SIDES
        },
        "seconds": spread([f["seconds"] for f in figures]),
        "missed_s": spread([f["missed_s"] for f in figures if f["side"] != "simulator"]),
        "back_s": spread([f["back_s"] for f in figures]),
        "send_errors": counters.get("send_errors", 0),
    }
    for key in ("speed_max", "acceleration_max", "jerk_max", "gap_jump_max_mm", "states_visited"):
        told[key] = verdict[key]
    sys.stdout.write(f"\ncable: {json.dumps(told, indent=2)}\n")
    assert_soft(verdict)
    assert verdict["is_parked"]
    return told


def test_two_pulls(tmp_path: Path) -> None:
    told = pulls(tmp_path, [("simulator", 0.7), ("base", 0.35)], seed=1)
    assert told["outcomes"] == {"simulator": {"HOLD": 1}, "server": {}, "base": {"FAULT": 1}}


def test_pulls(tmp_path: Path) -> None:
    random = Random(1890)
    sides = list(SIDES)
    shortest, longest = math.log(0.02), math.log(5.0)
    plan = [
        (sides[number % len(sides)], math.exp(random.uniform(shortest, longest)))
        for number in range(rounds(20))
    ]
    pulls(tmp_path, plan, seed=1891)
