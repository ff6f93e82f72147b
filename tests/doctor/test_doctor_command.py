"""The command on this machine, its JSON, and the notes that show the same commands."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
import tomli_w
from rig import environment, free_port

from motionserver.doctor import examine, measure, mends
from motionserver.doctor.examine import NOT_MEASURED, machine_findings
from motionserver.doctor.finding import Finding, Level
from motionserver.doctor.report import Report
from motionserver.doctor.tree import Tree
from motionserver.evaluate.bench.processes import BenchError
from motionserver.settings.config import load_config

ROOT = Path(__file__).parents[2]
MACHINE = [
    "wake-up lateness", "stalls", "timer grain", "scheduling class", "steal time",
    "real-time throttle", "memory lock", "frequency governor", "processors", "processor quota",
    "transparent huge pages", "clock source", "swap", "kernel's stalls", "open files",
    "receive buffer", "clock of day", "Python", "libraries", "optional solvers", "BLAS threads",
    "run directory", "state directory",
]  # fmt: skip
OF_CONFIG = [
    "configuration", "platform's address", "native source", "page's address",
    "way to the platform", "page's tokens", "native key", "enable switch",
]  # fmt: skip


def ask(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "motionserver", "doctor", *arguments],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
        env=environment(),
        cwd=ROOT,
    )


def configured(tmp_path: Path, **platform: object) -> Path:
    key = tmp_path / "key"
    key.write_bytes(b"k" * 32)
    key.chmod(0o600)
    (tmp_path / "switch").write_text("0")
    path = tmp_path / "server.toml"
    sections = {
        "server": {"run_dir": str(tmp_path / "run"), "state_dir": str(tmp_path / "state")},
        "platform": {"local_port": free_port(), "rate_hz": 100.0, **platform},
        "sources": [{"listen": f"127.0.0.1:{free_port()}", "key_file": str(key)}],
        "operator": {"enable_input": str(tmp_path / "switch")},
        "web": {"port": 0},
    }
    path.write_text(tomli_w.dumps(sections), "utf-8")
    return path


def test_on_this_machine(tmp_path):
    config, out = configured(tmp_path), tmp_path / "out.json"
    ended = ask(str(config), "--seconds", "0.5", "--json", str(out))
    assert ended.stderr == ""
    found = json.loads(out.read_text("utf-8"))
    levels = {finding["name"]: finding["level"] for finding in found["findings"]}
    assert list(levels) == MACHINE + OF_CONFIG
    for name in OF_CONFIG:
        assert levels[name] == "ok", name
    assert ended.returncode == int("problem" in levels.values())
    lines = ended.stdout.splitlines()
    assert lines[0] == found["promise"]
    assert lines[0].startswith("guard at 300 Hz: ")
    for finding in found["findings"]:
        assert f"{finding['level']:<9}{finding['name']}" in ended.stdout
        assert finding["mend"] in ended.stdout
    assert not (tmp_path / "run").exists()
    assert not (tmp_path / "state").exists()


def test_the_json_keeps_its_shape(tmp_path):
    report = examine.examine(load_config(None), None, 0.2, Tree())
    shape = json.loads(json.dumps(report.to_mapping()))
    assert list(shape) == [
        "format", "version", "promise", "worst", "config", "measured", "machine", "findings",
    ]  # fmt: skip
    assert shape["format"] == 1
    assert shape["config"] is None
    assert shape["worst"] in list(Level)
    assert list(shape["measured"]) == [
        "rate_hz", "seconds", "scheduling", "ticks", "lost", "stalls",
        "late_p50_ms", "late_p99_ms", "late_p999_ms", "late_max_ms",
    ]  # fmt: skip
    assert shape["measured"]["rate_hz"] == 240.0
    assert shape["measured"]["ticks"] > 0
    assert [finding["name"] for finding in shape["findings"]] == MACHINE
    for finding in shape["findings"]:
        assert list(finding) == ["name", "level", "found", "means", "mend"]
        assert all(isinstance(value, str) for value in finding.values())
        assert finding["level"] in list(Level)
        assert finding["found"]
        assert finding["means"]


def test_a_problem_ends_with_one(tmp_path):
    config = configured(tmp_path, local_host="192.0.2.77")
    ended = ask(str(config), "--seconds", "0.2")
    assert ended.returncode == 1
    # problems come first
    body = ended.stdout.partition("\n\n")[2]
    assert body.startswith("problem  ")
    assert "is no address of this computer" in body


def test_a_wrong_configuration_ends_with_two_and_one_line(tmp_path):
    path = tmp_path / "wrong.toml"
    path.write_text("[platform]\nrate_hz = 5\n")
    ended = ask(str(path))
    assert ended.returncode == 2
    assert ended.stdout == ""
    assert ended.stderr.startswith("motionserver: ")


def test_what_only_the_whole_configuration_shows_is_a_finding(tmp_path):
    config = configured(tmp_path)
    (tmp_path / "key").write_bytes(b"short")
    found = examine.configuration(load_config(config), config)
    assert found.level is Level.PROBLEM
    assert "5 bytes" in found.found
    assert found.mend


@pytest.mark.parametrize(
    ("levels", "status"),
    [
        ([Level.OK], 0),
        ([Level.UNKNOWN, Level.ADVICE, Level.WARNING], 0),
        ([Level.WARNING, Level.PROBLEM, Level.OK], 1),
    ],
)
def test_only_problems_change_the_exit_status(levels, status):
    findings = tuple(Finding(str(level), level, "found", "means") for level in levels)
    report = Report("promise", findings, None, None)
    assert report.exit_status == status
    text = report.to_text()
    order = [line.split()[0] for line in text.splitlines()[4:] if line[:1].strip()]
    shown = order[: len(levels)]
    assert shown == sorted(levels, key=lambda level: -level.rank)
    assert "give CONFIG.toml" in text


def test_a_machine_that_shows_nothing_is_unknown_and_no_problem(tmp_path):
    for finding in machine_findings(Tree(tmp_path)):
        assert finding.level is Level.UNKNOWN, finding.name


def test_a_sentinel_that_cannot_run_promises_nothing(monkeypatch):
    def refuse(*_):
        raise BenchError("bench: it ended and said nothing")

    monkeypatch.setattr(measure, "sleep_beside", refuse)
    report = examine.examine(load_config(None), None, 0.1, Tree())
    assert report.promise == NOT_MEASURED
    assert report.measured is None
    assert [f.level for f in report.findings[:2]] == [Level.UNKNOWN] * 2
    assert "it ended and said nothing" in report.findings[0].found


@pytest.mark.parametrize("command", mends.MACHINE_WIDE)
def test_the_notes_show_every_command(command):
    notes = (ROOT / "deploy/realtime.md").read_text("utf-8").replace("\\|", "|")
    assert f"`{command}`" in notes


def test_every_command_of_the_machine_is_among_them():
    named = {
        value.format(port=991, source="tsc")
        for key, value in vars(mends).items()
        if key.isupper() and isinstance(value, str)
    }
    assert named == set(mends.MACHINE_WIDE)


def test_the_two_limits_of_the_notes_are_what_the_command_writes():
    notes = (ROOT / "deploy/realtime.md").read_text("utf-8")
    for line in ("- rtprio 60", "- nice -10"):
        assert f"$USER {line}" in mends.REALTIME_USER
        assert f"`NAME {line}`" in notes
