"""The short drive that `check` makes before it calls a machine valid."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from machines import compact, science_fit
from typer.testing import CliRunner

from motionserver.cli.commands import app
from motionserver.errors import ConfigError
from motionserver.evaluate.trial import (
    SHORTEST,
    Trial,
    demanding_drive,
    refuse_lost,
    trial_lines,
    try_drive,
)
from motionserver.settings.tuning import apply_changes, default_for

PRESET = (
    Path(__file__).parents[2] / "motionserver" / "presets" / "platforms" / "t2-compact.toml"
).read_text("utf-8")
GOOD = Trial("mpc", 5.0, 300, {}, {}, 0, 4, 0, 0, 0.004, 1 / 60)


def tuned(machine, algorithm):
    return apply_changes(default_for(machine), {"algorithm": algorithm}).to_tuning()


def test_drive_asks_for_every_axis():
    drive = demanding_drive(3.0)
    spread = np.ptp(np.column_stack((drive.force, drive.rates)), axis=0)
    assert (spread[:3] > 1.0).all()
    assert (spread[3:] > 0.1).all()
    assert drive.force[0] == pytest.approx([0.0, 0.0, 9.81], abs=0.01)


@pytest.mark.parametrize("algorithm", ["mpc", "classical"])
@pytest.mark.parametrize("machine", [compact(), science_fit()], ids=lambda m: m.name)
def test_machine_that_can_be_driven_is_not_refused(machine, algorithm):
    trial = try_drive(machine, tuned(machine, algorithm), 1 / 60)
    refuse_lost(trial, machine)
    assert trial.seconds >= SHORTEST
    assert trial.periods >= 60 * SHORTEST
    assert trial.violations == 0
    assert trial.lost == 0 or algorithm == "classical"


def test_machine_on_which_the_solver_runs_out_of_its_budget_is_refused():
    """Legs so gentle that no plan of some seconds keeps to them."""
    weak = replace(compact(), leg_speed=0.03, leg_acceleration=0.2, leg_jerk=0.8)
    trial = try_drive(weak, tuned(weak, "mpc"), 1 / 60)
    assert trial.lost > 0.2 * trial.periods
    with pytest.raises(ConfigError, match=r"in \d+ of \d+ periods .* mpc brought no plan"):
        refuse_lost(trial, weak)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"troubles": {"budget": 61}}, "in 61 of 300 periods .*budget: 61"),
        ({"rejections": {"leg-length": 61}}, "leg-length: 61"),
        ({"stopped": 61}, "nothing of the plan passed: 61"),
        ({"violations": 1}, "broke a limit"),
    ],
)
def test_trial_with_too_many_lost_periods_is_refused(change, words):
    refuse_lost(GOOD, compact())
    with pytest.raises(ConfigError, match=words):
        refuse_lost(replace(GOOD, **change), compact())


def test_trial_with_few_lost_or_late_periods_warns():
    assert len(trial_lines(GOOD)) == 1
    lines = trial_lines(replace(GOOD, troubles={"budget": 3}, late=20, median=0.0123))
    assert "warning    in 3 of 300 periods" in lines[1]
    assert "20 of 300 plans took longer here and now than the period of 16.7 ms" in lines[2]
    assert "median 12.3 ms" in lines[2]
    refuse_lost(replace(GOOD, troubles={"budget": 3}, late=300), compact())


def check(*words):
    return CliRunner().invoke(app, ["check", *words])


def test_check_drives_before_it_says_valid(tmp_path):
    path = tmp_path / "weak.toml"
    text = PRESET
    for old, new in (
        ("speed = 0.6", "speed = 0.03"), ("acceleration = 8.0", "acceleration = 0.2"),
        ("jerk = 200.0", "jerk = 0.8"), ("speed = 0.15", "speed = 0.02"),
        ("acceleration = 0.5", "acceleration = 0.05"), ("jerk = 2.0", "jerk = 0.5"),
    ):  # fmt: skip
        assert old in text
        text = text.replace(old, new, 1)
    path.write_text(text, "utf-8")
    ended = check("--platform", str(path))
    assert isinstance(ended.exception, ConfigError)
    assert "valid" not in ended.stdout
    assert "brought no plan" in str(ended.exception)
    skipped = check("--platform", str(path), "--no-drive")
    assert skipped.exit_code == 0
    assert "valid" in skipped.stdout
    assert "drive  " not in skipped.stdout


def test_check_of_the_preset_says_how_it_drove():
    ended = check("--platform", "t2-compact")
    assert ended.exit_code == 0
    said = " ".join(ended.stdout.split())
    assert "s off-line with mpc" in said
    assert "each with a plan" in said
    assert "0 samples beyond a limit" in said
