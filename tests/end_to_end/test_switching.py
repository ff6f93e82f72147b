"""Algorithms take over from each other while the base moves; the base's own verdict decides.

The planner runs at 60 Hz here: a Moog base takes one packet per sixtieth of a second and every
plan is made for a packet.
"""

import itertools
import json
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from rig import Rig, assert_soft, environment

from motionserver.telemetry.recorded import read_recorded
from motionserver.telemetry.requests import ask

NAMES = ("mpc", "classical", "thondel2014")
ONE_DRIVE = ["PARKED", "RAISING", "READY", "RUN", "PARKING", "PARKED"]
SIDE = {"planner": {"side_engines": ["mpc", "classical"]}, "cueing": {"algorithm": "thondel2014"}}


class Http:
    """The page's requests, with the operator's token."""

    def __init__(self, rig: Rig) -> None:
        self.url = f"http://127.0.0.1:{rig.page_port}"
        tokens = rig.folder / "state" / "tokens.json"
        rig.wait_for(tokens.exists, "the tokens")
        self.token = json.loads(tokens.read_text("utf-8"))["operator"]

    def send(self, method: str, path: str, body: object = None, **headers: str) -> dict[str, Any]:
        data = None if body is None else json.dumps(body).encode()
        named = {"authorization": f"Bearer {self.token}", "content-type": "application/json"}
        request = urllib.request.Request(self.url + path, data, {**named, **headers}, method=method)
        with urllib.request.urlopen(request, timeout=10.0) as answer:
            return json.loads(answer.read())

    def drive_with(self, algorithm: str) -> None:
        """Ask until the planner takes it: a loaded page may have to be asked again."""
        for _ in range(20):
            try:
                version = self.send("GET", "/api/tuning")["version"]
                changes = {"algorithm": algorithm}
                self.send("PATCH", "/api/tuning", changes, **{"if-match": f'"{version}"'})
            except (OSError, urllib.error.URLError):
                time.sleep(0.1)
            else:
                return
        raise AssertionError(f"the page does not take {algorithm}")


@contextmanager
def load(port: int, seconds: float) -> Iterator[list[dict[str, float]]]:
    """Two connections that ask as fast as they are answered, two readers of the stream."""
    command = [sys.executable, "-m", "motionserver.evaluate.bench.load"]
    pressing = subprocess.Popen(
        [*command, str(port), str(seconds), "2", "2"],
        env=environment(),
        stdout=subprocess.PIPE,
        text=True,
    )
    found: list[dict[str, float]] = []
    try:
        yield found
        found.append(json.loads(pressing.communicate(timeout=30.0)[0]))
    finally:
        pressing.kill()
        pressing.wait()


def assert_explained(guard: dict[str, Any]) -> None:
    """Every rejection has a reason of its own."""
    counters = guard["counters"]
    reasons = {k: v for k, v in counters.items() if k.startswith("rejected_")}
    assert sum(reasons.values()) == counters.get("plans_rejected", 0), counters
    assert all(rejection["reason"] for rejection in guard["rejections"])


def test_three_algorithms_change_places(tmp_path: Path) -> None:
    with Rig(tmp_path, SIDE) as rig:
        rig.run()
        out = tmp_path / "drive.csv"
        recorder = subprocess.Popen(
            [sys.executable, "-m", "motionserver", "record", str(rig.config), "--out", str(out)],
            env=environment(),
            stdout=subprocess.PIPE,
            text=True,
        )
        rig.wait_plans(120)
        for algorithm in NAMES:
            version = ask(rig.run_dir / "planner.sock", {"op": "tuning"})["version"]
            request = {"op": "tune", "if_version": version, "changes": {"algorithm": algorithm}}
            assert ask(rig.run_dir / "planner.sock", request)["ok"]
            rig.wait_for(
                lambda a=algorithm: rig.shown("planner").get("algorithm") == a, "the switch"
            )
            rig.wait_plans(60)
        planner, guard = rig.shown("planner"), rig.shown()
        assert rig.end() == 0
        said = recorder.communicate(timeout=30.0)[0]
        assert [to for _, to in rig.way()] == ONE_DRIVE
        verdict = rig.verdict()
    assert_soft(verdict)
    assert_explained(guard)
    assert planner["counters"]["switches"] == 3
    assert planner["counters"]["plans_thought_classical"] >= 60
    side = planner["side"]
    # each takes the place of the one that takes over
    assert side["driving"]["name"] == "thondel2014"
    assert {engine["name"] for engine in side["engines"]} == {"mpc", "classical"}
    for engine in (side["driving"], *side["engines"]):
        assert 0.0 < engine["nrmse"] < 1.5
        assert engine["leg_use"] < 1.0
    assert "the server ended" in said
    recorded = read_recorded(out)
    assert set(NAMES) <= set(recorded.words["algorithm"])
    assert set(NAMES) == set(recorded.engines)


@pytest.mark.campaign
@pytest.mark.timeout(300)
def test_all_algorithms_in_turn_for_a_minute_under_load(tmp_path: Path) -> None:
    with Rig(tmp_path, SIDE, web=True) as rig:
        rig.run()
        http = Http(rig)
        turns = list(itertools.islice(itertools.cycle(NAMES), 20))
        with load(rig.page_port, 62.0) as pressed:
            time.sleep(1.0)
            due = time.monotonic()
            for algorithm in turns:
                http.drive_with(algorithm)
                due += 3.0
                time.sleep(max(0.0, due - time.monotonic()))
        planner, guard = rig.shown("planner"), rig.shown()
        assert rig.end() == 0
        transitions = rig.transitions()
        verdict = rig.verdict()
    counters = planner["counters"]
    print(json.dumps({"load": pressed, "guard": guard["counters"], "planner": counters,
                      "side": planner["side"], "tick": guard["tick"]["late_p99_ms"],
                      "solver": planner["solver"], "speed_max": verdict["speed_max"],
                      "acceleration_max": verdict["acceleration_max"]}, indent=1))  # fmt: skip
    assert_soft(verdict)
    assert_explained(guard)
    assert ("RUN", "HOLD") not in transitions, transitions
    assert counters["switches"] == len(turns)
    assert counters.get("tick_errors", 0) == 0
    assert pressed[0]["requests_per_s"] > 100.0
    for name in NAMES:
        assert counters[f"plans_thought_{name}"] > 300
    assert all(engine["raised"] == 0 for engine in planner["side"]["engines"])
