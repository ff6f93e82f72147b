"""What is written at the prompt means something, or is refused."""

import inspect
import re

import pytest
import typer
from typer.testing import CliRunner

from motionserver.cli import judging, offline, tuning
from motionserver.cli.modes import EVALUATE
from motionserver.errors import ConfigError
from motionserver.evaluate.compare import command as comparison
from motionserver.evaluate.omct import command as sine_test
from motionserver.evaluate.tune.command import tune as search

CALLS = ("run_evaluate", "run_predictions", "compare", "omct")


@pytest.fixture
def called(monkeypatch):
    """What a command would have done."""
    seen = []

    def note(name):
        return lambda *given, **_: seen.append((name, given)) or 0

    for place, name in zip((offline, offline, comparison, sine_test), CALLS, strict=True):
        monkeypatch.setattr(place, name, note(name))
    for name in ("run_tune", "run_predictor"):
        monkeypatch.setattr(tuning, name, note(name))
    return seen


def prompt(words):
    return CliRunner().invoke(judging.app, words.split())


@pytest.mark.parametrize(
    ("words", "call"),
    [
        ("evaluate drive.csv --rate 250 --setpoints a.csv --json b.json --html c.html", 0),
        ("evaluate drive.csv --predictions --tuning gentle --scale 0.5", 1),
        ("evaluate --compare folder --held-out result.json --out here --disturb --seed 2", 2),
        ("evaluate omct --amplitude 2 --boundaries file.toml --out here --jobs 1", 3),
    ],
)
def test_what_a_mode_takes_reaches_it(words, call, called):
    done = prompt(words)
    assert done.exit_code == 0, done.exception
    assert [name for name, _ in called] == [CALLS[call]]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("drive.csv --held-out r.json", "--held-out: means nothing with INPUT.csv.*--compare"),
        ("drive.csv --boundaries b.toml", "--boundaries: means nothing with INPUT.csv.*omct"),
        ("drive.csv --predictions --preview 2", "--preview: means nothing with --predictions"),
        ("--compare folder --predictions", "--predictions: means nothing with --compare"),
        ("--compare folder --html out.html", "--html: means nothing with --compare.*INPUT.csv"),
        ("drive.csv --compare folder", r"INPUT\.csv: means nothing with --compare"),
        ("omct --disturb", "--disturb: means nothing with omct"),
        ("omct --rate 250", "--rate: means nothing with omct"),
    ],
)
def test_what_would_say_nothing_is_refused(words, message, called):
    done = prompt(f"evaluate {words}")
    assert isinstance(done.exception, ConfigError), done.output
    assert re.search(message, str(done.exception))
    assert called == []


def test_a_fit_takes_recordings_and_a_folder_only(called):
    assert prompt("tune a.csv --out here --predictor mine").exit_code == 0
    refused = prompt("tune a.csv --out here --predictor mine --head 0,0,0.7")
    assert "--head: means nothing with --predictor" in str(refused.exception)
    assert prompt("tune a.csv b.csv --out here --head 0,0,0.7").exit_code == 0
    assert [name for name, _ in called] == ["run_predictor", "run_tune"]


@pytest.mark.parametrize("words", ["drive.csv", "--compare folder", "omct"])
def test_a_planner_rate_of_nothing_is_not_taken_for_none_given(words, called):
    done = prompt(f"evaluate {words} --planner-rate 0")
    assert "--planner-rate: 0 Hz is out of range" in str(done.exception)
    assert called == []


def test_every_parameter_of_evaluate_goes_somewhere():
    group = typer.main.get_command(judging.app)
    names = {each.name for each in group.commands["evaluate"].params} - {"help"}
    assert names == frozenset().union(*EVALUATE.values())


def test_a_search_has_the_same_defaults_at_the_prompt_and_as_a_function():
    command = typer.main.get_command(judging.app).commands["tune"]
    params = {each.name: each.default for each in command.params}
    known = inspect.signature(search).parameters
    other = {"planner_hz": "planner_rate", "tilt_rate_deg_s": "tilt_rate"}
    # at the prompt one process drives, for the function this one; nobody's head is the machine's
    asked = set(known) - {"recordings", "out", "progress", "jobs", "head"}
    assert len(asked) >= 11
    assert {name: params[other.get(name, name)] for name in asked} == {
        name: known[name].default for name in asked
    }
