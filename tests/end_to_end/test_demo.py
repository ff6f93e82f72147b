"""The demo as people start it: each algorithm ends well, and so does each fault."""

import json
from pathlib import Path

import pytest
from rig import cli


def demo(folder: Path, *arguments: str) -> dict[str, object]:
    out = folder / "verdict.json"
    ended = cli("demo", "--seconds", "12", "--no-page", "--json", str(out), *arguments, timeout=240)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert "Traceback" not in ended.stderr
    verdict: dict[str, object] = json.loads(out.read_text("utf-8"))
    assert verdict["violations"] == 0
    return verdict


def test_the_demo_runs_and_parks(tmp_path: Path) -> None:
    verdict = demo(tmp_path, "--algorithm", "thondel2014")
    states = verdict["server_states"]
    assert isinstance(states, list)
    assert states[-1] == "PARKED"
    assert "RUN" in states
    assert verdict["is_parked"]


@pytest.mark.campaign
@pytest.mark.parametrize("algorithm", ["classical", "thondel2014"])
@pytest.mark.parametrize(
    "fault", ["", "cue-loss", "nan", "planner-kill", "guard-kill", "web-kill", "platform-loss"]
)
def test_every_fault_of_the_demo_is_answered(tmp_path: Path, fault: str, algorithm: str) -> None:
    demo(tmp_path, "--algorithm", algorithm, *(("--fault", fault) if fault else ()))


@pytest.mark.parametrize("wrong", [("--fault", "fire"), ("--recording", "moon")])
def test_what_the_demo_does_not_know(wrong: tuple[str, str]) -> None:
    ended = cli("demo", *wrong)
    assert ended.returncode == 2
    assert ended.stderr.startswith(f"motionserver: {wrong[0]}: unknown")
