"""init: files to begin with, the same as in deploy/ and accepted as they are."""

import tomllib
from pathlib import Path

import pytest
from in_process import Cli, typed

from motionserver.settings.config import PREFIX, load_config
from motionserver.settings.reference import annotated_config

DEPLOY = Path(__file__).parents[2] / "deploy"


@pytest.fixture
def cli(capsys, monkeypatch) -> Cli:
    return typed(capsys, monkeypatch)


def test_init_without_options_prints_the_documented_file(cli):
    ended = cli("init")
    assert (ended.returncode, ended.stderr) == (0, "")
    assert ended.stdout == (DEPLOY / "motionserver.toml").read_text("utf-8")


def test_init_with_an_environment_prints_the_same(cli, monkeypatch):
    monkeypatch.setenv(f"{PREFIX}PLATFORM__PORT", "7")
    assert cli("init").stdout == (DEPLOY / "motionserver.toml").read_text("utf-8")


@pytest.mark.parametrize(
    ("name", "key", "value"),
    [
        ("", "preset", "t2-compact"),
        ("t2-compact", "preset", "t2-compact"),
        ("moog-6dof2000e", "format", "moog-6dof2000e"),
    ],
)
def test_init_with_a_platform_enters_it_and_check_accepts_the_file(cli, tmp_path, name, key, value):
    path = tmp_path / "my.toml"
    path.write_text(cli("init", "--platform", name).stdout, "utf-8")
    assert tomllib.loads(path.read_text("utf-8"))["platform"][key] == value
    ended = cli("check", str(path))
    assert ended.returncode == 0
    assert f"{path}: valid" in ended.stdout


def test_init_with_a_machine_file_enters_its_whole_path(cli, tmp_path, monkeypatch):
    machine = Path(__file__).parents[2] / "motionserver/presets/platforms/t2-compact.toml"
    (tmp_path / 'my "rig".toml').write_bytes(machine.read_bytes())
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "my.toml"
    path.write_text(cli("init", "--platform", 'my "rig".toml').stdout, "utf-8")
    assert load_config(path).platform.preset == str(tmp_path / 'my "rig".toml')


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("moon", "--platform: unknown 'moon'. Allowed: t2-compact, moog-6dof2000e, or the path"),
        ("missing.toml", "missing.toml: cannot be read (No such file or directory)"),
    ],
)
def test_init_with_an_unknown_platform_says_what_is_allowed(cli, name, words):
    ended = cli("init", "--platform", name)
    assert (ended.returncode, ended.stdout) == (2, "")
    assert words in ended.stderr


@pytest.mark.parametrize(
    ("option", "name"), [("--unit", "motionserver.service"), ("--zenoh", "zenoh-secure.json5")]
)
def test_init_prints_the_other_files_of_a_deployment(cli, option, name):
    assert cli("init", option).stdout == (DEPLOY / name).read_text("utf-8")


def test_init_asked_for_two_files_refuses(cli):
    ended = cli("init", "--unit", "--platform", "t2-compact")
    assert (ended.returncode, ended.stdout) == (2, "")
    assert "--platform and --unit" in ended.stderr


def test_values_are_written_as_toml_reads_them():
    odd = 'a "quoted" \\ path\nwith\ttab, \x7f and ü'
    text = annotated_config({"platform": {"preset": odd, "port": 5}, "server": {"realtime": False}})
    found = tomllib.loads(text)
    assert found["platform"]["preset"] == odd
    assert (found["platform"]["port"], found["server"]["realtime"]) == (5, False)


def test_run_without_a_file_says_how_to_get_one(cli):
    ended = cli("run")
    assert (ended.returncode, ended.stdout) == (2, "")
    assert "motionserver init > my.toml" in ended.stderr
    assert "motionserver demo" in ended.stderr


def test_run_with_a_missing_file_says_how_to_get_one(cli, tmp_path):
    ended = cli("run", str(tmp_path / "my.toml"))
    assert ended.returncode == 2
    assert "motionserver init > my.toml" in ended.stderr


def test_the_shell_completes_commands(cli, monkeypatch):
    assert "--install-completion" in cli("--help").stdout
    monkeypatch.setenv("_MOTIONSERVER_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", "motionserver en")
    monkeypatch.setenv("COMP_CWORD", "1")
    assert cli().stdout.split() == ["engage"]
