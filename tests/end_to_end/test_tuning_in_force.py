"""Tuning a real server: what cannot be used is refused, and a start never dies of it."""

import json
from importlib.util import find_spec
from pathlib import Path

import pytest
from faults.process_hands import kill
from rig import Rig

from motionserver.telemetry.requests import ask

pytestmark = pytest.mark.skipif(find_spec("casadi") is not None, reason="needs a missing solver")


def tuning(rig, **request):
    return ask(rig.run_dir / "planner.sock", {"op": "tuning", **request}, timeout=5.0)


def settled(rig):
    def answer():
        told = tuning(rig)
        return None if told["is_ramping"] else told

    return rig.wait_for(answer, "the tuning to come into force")


def test_missing_solver_is_refused_and_a_kept_one_falls_back_at_the_start(tmp_path: Path) -> None:
    with Rig(tmp_path) as rig:
        rig.wait_for(lambda: rig.shown("planner").get("tuning"), "the planner's word", 200.0)
        before = settled(rig)
        assert before["in_force"] == before["values"]
        refused = tuning(rig, op="tune", if_version=before["version"], changes={"backend": "hpipm"})
        assert refused["details"][0]["field"] == "backend"
        assert "pip install" in refused["details"][0]["allowed"]
        taken = tuning(rig, op="tune", if_version=before["version"], changes={"scale": 0.3})
        assert taken["ok"]
        told = settled(rig)
        assert (told["in_force"]["scale"], told["in_force"]) == (0.3, told["values"])

        # the library is lost while the server runs, and then the planner dies
        file = rig.run_dir / "tuning.json"
        rig.wait_for(lambda: json.loads(file.read_text())["worked"], "the mark in the kept tuning")
        kept = json.loads(file.read_text())
        kept["former"].append({"values": kept["values"], "worked": True})
        kept["values"] = {**kept["values"], "backend": "hpipm", "scale": 0.9}
        file.write_text(json.dumps(kept))
        old = kill(rig, "planner")
        rig.wait_for(lambda: rig.shown("planner").get("pid") not in (None, old), "a planner", 200.0)
        told = settled(rig)
        assert told["in_force"] == told["values"]
        assert (told["values"]["backend"], told["values"]["scale"]) == ("daqp", 0.3)
        assert "hpipm" in told["fallback"]
        assert "cannot be used" in rig.text()
        assert rig.shown("service")["restarts"]["planner"] == 1
        assert rig.end() == 0


def test_configuration_with_a_missing_solver_does_not_start(tmp_path: Path) -> None:
    config = {"cueing": {"tuning": {"backend": "hpipm"}}}
    with Rig(tmp_path, config) as rig:
        assert rig.server.wait(60.0) != 0
        assert "pip install 'motionserver[hpipm]'" in rig.text()
