"""The systemd unit and the container agree with what the code does."""

import configparser
import shutil
import subprocess
from pathlib import Path

import pytest

from motionserver.guard import __main__ as guard_process
from motionserver.planner import loop as planner_process
from motionserver.supervisor.guards import PARK_PATIENCE

DEPLOY = Path(__file__).parents[2] / "deploy"
UNIT = DEPLOY / "motionserver.service"


class ManyValues(dict):
    """systemd lets a key stand several times; the values are collected."""

    def __setitem__(self, key, value):
        if key in self and isinstance(value, list):
            self[key].extend(value)
        else:
            super().__setitem__(key, value)


@pytest.fixture(scope="module")
def service():
    parser = configparser.ConfigParser(dict_type=ManyValues, strict=False, interpolation=None)
    parser.optionxform = str
    parser.read(UNIT)
    return parser["Service"]


def test_it_is_stopped_by_a_signal_that_parks_and_waits_for_it(service):
    assert service["KillSignal"] == "SIGTERM"
    assert service["KillMode"] == "control-group"
    assert float(service["TimeoutStopSec"]) > PARK_PATIENCE


def test_what_a_person_must_mend_is_not_started_again(service):
    assert service["RestartPreventExitStatus"].split() == ["2", "3"]


def test_the_processes_may_have_the_priorities_they_ask_for(service):
    asked = guard_process.PRIORITY, planner_process.PRIORITY
    assert int(service["LimitRTPRIO"]) >= max(asked)
    assert service["RestrictRealtime"] == "no"
    assert "CPUSchedulingPolicy" not in service


def test_the_containers_grant_the_same(service):
    compose = (DEPLOY / "compose.yaml").read_text("utf-8")
    assert f"rtprio: {service['LimitRTPRIO']}" in compose
    assert f"stop_grace_period: {service['TimeoutStopSec']}s" in compose


def test_every_file_is_in_the_index():
    index = (DEPLOY / "README.md").read_text("utf-8")
    for path in DEPLOY.iterdir():
        if path.name != "README.md":
            assert f"`{path.name}`" in index


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd-analyze here")
def test_systemd_finds_little_exposed():
    found = subprocess.run(
        ["systemd-analyze", "security", "--offline=true", "--threshold=15", str(UNIT)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    if "Overall exposure" not in found.stdout:
        pytest.skip(f"systemd-analyze does not work here: {found.stderr.strip()[:200]}")
    assert found.returncode == 0, found.stdout[-300:]
