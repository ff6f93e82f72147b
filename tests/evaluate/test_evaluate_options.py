"""From the prompt to machine and tuning."""

from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from motionserver.cli import judging as commands
from motionserver.cli import offline
from motionserver.cueing.tuning import Tuning
from motionserver.errors import ConfigError
from motionserver.evaluate.disturbance import Disturbance
from motionserver.evaluate.options import EvaluateOptions, machine_at, tuning_from
from motionserver.settings.machine import load_machine

MACHINE = load_machine("t2-compact")


def test_nothing_said_is_the_default():
    tuning = tuning_from(MACHINE)
    assert tuning.reference == Tuning().reference
    assert tuning.tilt_rate == pytest.approx(Tuning().tilt_rate)
    assert machine_at(MACHINE, "") is MACHINE


def test_head_reference_and_rate():
    assert machine_at(MACHINE, "0, 0,0.7").head == pytest.approx([0.0, 0.0, 0.7])
    tuning = tuning_from(MACHINE, reference="constant", tilt_rate="6", scale=0.3)
    assert tuning.reference == "constant"
    assert np.degrees(tuning.tilt_rate) == pytest.approx(6.0)
    assert tuning.scale == 0.3
    assert np.degrees(tuning_from(MACHINE, tilt_rate="free").tilt_rate) == pytest.approx(1000.0)


def test_preset_by_name_and_by_file(tmp_path):
    assert np.degrees(tuning_from(MACHINE, "active-driver-6deg").tilt_rate) == pytest.approx(6.0)
    file = tmp_path / "My Own.toml"
    file.write_text('about = "mine"\n[values]\ngain = 0.25\nscale = 0.5\n')
    assert tuning_from(MACHINE, str(file)).gain == 0.25
    assert tuning_from(MACHINE, str(file), scale=0.7).scale == 0.7


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda path: machine_at(MACHINE, "0,0"), "--head: '0,0' is not X,Y,Z"),
        (lambda path: machine_at(MACHINE, "0,0,nan"), "--head"),
        (lambda path: machine_at(MACHINE, "0,0,70"), "at most 3"),
        (lambda path: tuning_from(MACHINE, reference="magic"), "--reference.*Allowed: constant"),
        (lambda path: tuning_from(MACHINE, tilt_rate="fast"), "--tilt-rate"),
        (lambda path: tuning_from(MACHINE, scale=1.5), "--scale: 1.5 is out of range"),
        (lambda path: EvaluateOptions("mpc", planner_hz=0.0), "--planner-rate: 0 Hz.*20 to 250"),
        (lambda path: EvaluateOptions("mpc", rate=-1.0), "--rate: -1 Hz.*10 to 2000"),
        (lambda path: EvaluateOptions("mpc", preview=9.0), "--preview: 9 s.*0 to 4"),
        (lambda path: tuning_from(MACHINE, "no-such"), "--tuning.*one of .*gentle"),
        (lambda path: tuning_from(MACHINE, str(path / "no.toml")), "cannot be read"),
        (lambda path: tuning_from(MACHINE, str(path / "bare.toml")), "no table"),
        (lambda path: tuning_from(MACHINE, str(path / "wrong.toml")), "gain"),
    ],
)
def test_wrong_words_are_refused(call, message, tmp_path):
    (tmp_path / "bare.toml").write_text("gain = 0.5\n")
    (tmp_path / "wrong.toml").write_text("[values]\ngain = 50.0\n")
    with pytest.raises(ConfigError, match=message):
        call(tmp_path)


def test_the_prompt_reaches_the_options(monkeypatch):
    seen = []
    monkeypatch.setattr(offline, "run_evaluate", lambda path, options: seen.append(options) or 0)
    words = "drive.csv --algorithm classical --head 0,0,0.7 --preview 2 --disturb --seed 5"
    done = CliRunner().invoke(commands.app, ["evaluate", *words.split(), "--planner-rate", "50"])
    assert done.exit_code == 0, done.output
    assert replace(seen[0], told=frozenset()) == EvaluateOptions(
        "classical", planner_hz=50.0, head="0,0,0.7", preview=2.0, disturb=True, seed=5
    )
    # what was not written may be as a live drive was
    assert {"algorithm", "head", "preview", "disturb", "planner_rate"} <= seen[0].told
    assert not {"platform", "scale", "rate", "tuning"} & seen[0].told
    assert seen[0].disturbance() == Disturbance(5)
    assert seen[0].algorithms() == ["classical"]
    assert seen[0].machine().head[2] == 0.7
    bare = CliRunner().invoke(commands.app, ["evaluate"])
    assert bare.exit_code != 0
