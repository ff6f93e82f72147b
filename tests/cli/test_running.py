"""Which server a command means when none is named, and what is said when there is none."""

import json
import os
import subprocess
import sys
import time

import pytest
from in_process import Cli, typed

from motionserver.cli import running
from motionserver.cli.running import Server, announced, find_server, running_servers
from motionserver.settings.config import PREFIX
from motionserver.telemetry.mapped import MappedFile

ASKING = ["engage", "park", "reset", "status", "record"]


@pytest.fixture(autouse=True)
def alone(tmp_path, monkeypatch):
    """A user of the tests' own: other servers on this machine are not seen."""
    for name in list(os.environ):
        if name.startswith(PREFIX):
            monkeypatch.delenv(name)
    base = tmp_path / "xdg"
    base.mkdir(mode=0o700)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(base))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "home"))
    monkeypatch.setattr(running, "UNIT_RUN_DIR", tmp_path / "unit")
    return base


@pytest.fixture
def cli(capsys, monkeypatch) -> Cli:
    return typed(capsys, monkeypatch)


def report(run_dir, age=0.0):
    """Leave what a guard shows."""
    run_dir.mkdir(parents=True, exist_ok=True)
    shown = {"t_ns": time.monotonic_ns() - int(age * 1e9), "state": "RUN", "reason": "driving"}
    MappedFile(run_dir / "guard.map", 32768).write(json.dumps(shown).encode())


def server(folder, name="demo"):
    return Server(folder / name / "run", folder / name / "state", name)


@pytest.mark.parametrize("command", ASKING)
def test_a_command_without_any_server_says_where_it_looked_and_how_to_start_one(
    cli, alone, command
):
    ended = cli(command)
    assert (ended.returncode, ended.stdout) == (2, "")
    assert ended.stderr.startswith(f"motionserver: {command}: no server is running")
    assert ended.stderr.count("\n") == 1
    for words in (
        f"{alone}/motionserver-992: the folder does not exist",
        "motionserver demo",
        "motionserver run CONFIG.toml",
        "motionserver init",
    ):
        assert words in ended.stderr
    assert "Errno" not in ended.stderr


@pytest.mark.parametrize("command", ASKING)
@pytest.mark.parametrize(
    ("folder", "words"),
    [
        ("missing", "the folder does not exist"),
        ("empty", "there is nothing of a running server in it"),
        ("old", "s old: RUN, driving"),
        ("broken", "it cannot be read"),
    ],
)
def test_a_command_with_a_configuration_says_what_is_in_its_folder(
    cli, tmp_path, command, folder, words
):
    (tmp_path / "empty").mkdir()
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "guard.map").write_bytes(b"nothing of ours, but long enough")
    report(tmp_path / "old", age=60.0)
    config = tmp_path / "c.toml"
    config.write_text(f'server.run_dir = "{tmp_path / folder}"\n', "utf-8")
    ended = cli(command, str(config))
    assert (ended.returncode, ended.stdout) == (2, "")
    assert f"{command}: no server runs in {tmp_path / folder}; " in ended.stderr
    assert words in ended.stderr
    assert "Errno" not in ended.stderr
    assert ended.stderr.count("\n") == 1


def test_an_announced_server_is_found_while_it_runs_and_not_after(tmp_path):
    demo = server(tmp_path)
    with announced(demo):
        assert running_servers() == [demo]
        assert find_server("status", None) == demo
    assert running_servers() == []


def test_a_server_in_the_default_folder_is_found_without_an_announcement(alone):
    report(alone / "motionserver-992")
    assert [one.run_dir for one in running_servers()] == [alone / "motionserver-992"]


def test_the_servers_of_the_unit_and_of_the_default_folder_are_both_found(alone, tmp_path):
    report(tmp_path / "unit")
    report(alone / "motionserver-992")
    assert {one.run_dir.name for one in running_servers()} == {"unit", "motionserver-992"}


def test_one_announced_in_the_default_folder_counts_once(alone, tmp_path):
    report(alone / "motionserver-992")
    with announced(Server(alone / "motionserver-992", tmp_path, "my.toml")):
        assert [one.title for one in running_servers()] == ["my.toml"]


@pytest.mark.parametrize("command", [*ASKING, "blackbox list", "blackbox show", "audit verify"])
def test_of_several_servers_one_must_be_named(cli, alone, tmp_path, command):
    report(alone / "motionserver-992")
    demo = server(tmp_path)
    with announced(demo):
        ended = cli(*command.split())
    assert (ended.returncode, ended.stdout) == (2, "")
    for words in (
        f"{command}: 2 servers are running",
        f"{alone / 'motionserver-992'} (default folder)",
        f"{demo.run_dir} (demo)",
        "--run-dir FOLDER",
    ):
        assert words in ended.stderr


def test_a_named_run_directory_decides_among_several(alone, tmp_path):
    report(alone / "motionserver-992")
    demo = server(tmp_path)
    with announced(demo):
        assert find_server("status", None, demo.run_dir) == demo


def test_the_environment_names_a_server_as_a_file_does(tmp_path, monkeypatch):
    report(tmp_path / "mine")
    monkeypatch.setenv(f"{PREFIX}SERVER__RUN_DIR", str(tmp_path / "mine"))
    with announced(server(tmp_path)):
        assert find_server("status", None).run_dir == tmp_path / "mine"


def test_what_a_killed_server_announced_is_not_taken_for_a_living_one(alone, tmp_path):
    demo = server(tmp_path)
    with announced(demo):
        (path,) = (alone / "motionserver-servers").glob("*.json")
        told = json.loads(path.read_text("utf-8"))
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    for pid, started in ((ended.pid, 1), (os.getpid(), 1)):
        path.write_text(json.dumps(told | {"pid": pid, "started": started}), "utf-8")
        assert running_servers() == []
        assert not path.exists()
    # its guard may outlive it, and parks
    path.write_text(json.dumps(told | {"pid": ended.pid, "started": 1}), "utf-8")
    report(demo.run_dir)
    assert running_servers() == [demo]


def test_an_announcement_that_others_could_have_written_is_not_read(alone, tmp_path):
    with announced(server(tmp_path)):
        (alone / "motionserver-servers").chmod(0o777)
        assert running_servers() == []


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"pid": "x", "started": 1}', "\xff"])
def test_a_damaged_announcement_is_skipped(alone, tmp_path, text):
    with announced(server(tmp_path)):
        (alone / "motionserver-servers" / "1.json").write_text(text, "latin-1")
        assert len(running_servers()) == 1


def test_dumps_are_those_of_the_running_server_or_else_of_the_default_folder(cli, tmp_path):
    demo = server(tmp_path)
    with announced(demo):
        assert cli("blackbox", "list").stdout == f"{demo.state_dir}/blackbox: no dumps\n"
    default = tmp_path / "home" / "motionserver"
    assert cli("blackbox", "list").stdout == f"{default}/blackbox: no dumps\n"


def test_a_server_that_does_not_answer_is_not_called_absent(cli, tmp_path):
    demo = server(tmp_path)
    report(demo.run_dir)
    with announced(demo):
        ended = cli("engage")
    assert ended.returncode == 2
    assert f"nobody listens at {demo.run_dir}/guard.sock" in ended.stderr
    assert "is running" in ended.stderr
    assert "Errno" not in ended.stderr


@pytest.mark.parametrize(
    ("given", "bases"),
    [
        ("", ["/tmp/motionserver-{}", "/run/user/{}"]),
        ("/run/user/{}", ["/run/user/{}", "/tmp/motionserver-{}"]),
        ("/elsewhere", ["/elsewhere"]),
    ],
)
def test_logins_with_and_without_a_runtime_folder_find_each_other(monkeypatch, given, bases):
    monkeypatch.setenv("XDG_RUNTIME_DIR", given.format(os.getuid()))
    folders = [str(folder.parent) for folder in running._announcement_folders()]
    assert folders == [base.format(os.getuid()) for base in bases]
