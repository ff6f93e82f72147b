"""The command, with real drives of a second: files, resuming, repeatability, refusals."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from own_hexapod import RECORDINGS
from typer.testing import CliRunner

from motionserver.cli.commands import app
from motionserver.cueing.tuning import Tuning
from motionserver.errors import ConfigError
from motionserver.evaluate.drive import no_motion
from motionserver.evaluate.lockstep import drive
from motionserver.evaluate.metrics.figures import figures_of
from motionserver.evaluate.recording import from_samples, read_recording
from motionserver.evaluate.tune import driving
from motionserver.evaluate.tune.command import tune
from motionserver.evaluate.tune.outcome import judge
from motionserver.evaluate.tune.preset import read_fold_tunings
from motionserver.evaluate.tune.stretches import Stretch, most_eventful
from motionserver.settings.machine import load_machine
from motionserver.settings.tuning import apply_changes, default_for
from motionserver.settings.tuning_presets import PresetShelf

MACHINE = load_machine("t2-compact")
DRIVES = [
    replace(read_recording(RECORDINGS / f"{name}.csv").excerpt(start, start + 6.0), name=name)
    for name, start in (("truck_brake_accel", 40.0), ("truck_roundabout", 55.0))
]
ASKED = {"algorithm": "classical", "trials": 3, "excerpt": 1.0, "planner_hz": 25.0, "seed": 4}


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tuned")
    told = []
    result = tune(DRIVES, out=folder, progress=lambda *at: told.append(at), **ASKED)
    return result, folder, told


def test_tells_about_every_drive(found):
    _, _, told = found
    assert told == [("pool", done, 6) for done in range(7)]


def test_preset_is_one_and_loads_as_what_was_driven(found, tmp_path):
    result, folder, _ = found
    shelf = PresetShelf(folder)
    assert "classical-rmse" in shelf.names()
    preset = shelf.read("classical-rmse")
    assert preset.values["algorithm"] == "classical"
    loaded = apply_changes(default_for(MACHINE), preset.values)
    assert loaded == result.final.trial.model
    assert loaded.to_tuning().gain == result.tuning.gain
    assert "on drives not seen" in preset.about
    again = PresetShelf(tmp_path).save("tuned", preset.about, preset.values)
    assert again.values == preset.values


def test_fold_tunings_come_back_from_the_file(found):
    result, folder, _ = found
    read = read_fold_tunings(folder / "result.json")
    assert list(read) == ["truck_brake_accel", "truck_roundabout"]
    for name, tuning in result.fold_tunings.items():
        assert read[name].gain == tuning.gain
        assert read[name].box.tobytes() == tuning.box.tobytes()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{}", "it has no 'schema'"),
        ('{"schema": "else"}', "its schema is 'else', not 'motionserver-tuning-1'"),
        ('{"schema": "motionserver-tuning-1", "base": {}, "folds": ["a"]}', "'items'"),
        ('{"schema": "motionserver-tuning-1", "base": {"gain": 9}, "folds": {}}', "gain"),
        ("[1]", "integers"),
        ("{", "delimiter|property name"),
    ],
)
def test_another_file_is_no_result(text, message, tmp_path):
    (tmp_path / "other.json").write_text(text)
    with pytest.raises(ConfigError, match=f"(?s)--held-out .*no result of 'motion.*{message}"):
        read_fold_tunings(tmp_path / "other.json")


def test_same_seed_same_files_and_nothing_driven_twice(found, tmp_path, monkeypatch):
    _, folder, _ = found
    kept = {path.name: path.read_bytes() for path in folder.iterdir()}
    with monkeypatch.context() as patch:
        patch.setattr(driving, "run", None)
        tune(DRIVES, out=folder, **ASKED)
    for name in ("classical-rmse.toml", "report.txt", "report.html", "result.json"):
        assert (folder / name).read_bytes() == kept[name]
    fresh = tune(DRIVES, out=tmp_path, **ASKED)
    said = (tmp_path / "result.json").read_text().replace(str(tmp_path), str(folder))
    assert said.encode() == kept["result.json"]
    assert len(fresh.trials) == 3


def test_stopped_search_goes_on(found, tmp_path, monkeypatch):
    result, _, _ = found
    real, count = driving.run, []

    def stops(job):
        if len(count) == 2:
            raise KeyboardInterrupt
        count.append(job)
        return real(job)

    monkeypatch.setattr(driving, "run", stops)
    with pytest.raises(KeyboardInterrupt):
        tune(DRIVES, out=tmp_path, **ASKED)
    monkeypatch.setattr(driving, "run", real)
    told = []
    again = tune(DRIVES, out=tmp_path, progress=lambda *at: told.append(at), **ASKED)
    assert told[0] == ("pool", 2, 6)
    assert again.held_out_score == result.held_out_score


def test_processes_do_not_change_the_result(found, tmp_path):
    result, _, _ = found
    two = tune(DRIVES, out=tmp_path, jobs=2, **ASKED)
    assert [t.outcomes for t in two.trials] == [t.outcomes for t in result.trials]
    assert two.command.replace(str(tmp_path), "") == result.command.replace(str(found[1]), "")


def test_reports_say_what_must_be_known(found):
    result, folder, _ = found
    text = (folder / "report.txt").read_text()
    page = (folder / "report.html").read_text()
    for said in (
        f"rmse on recordings not looked at: {result.held_out_score:.3f}",
        MACHINE.digest,
        "leave-one-out",
        "rank correlation",
        result.command,
        "no executed sample beyond a hard limit",
    ):
        assert said in text
    assert not re.search(r"(?:src|href)\s*=|https?://|@import|url\(", page)
    assert page.count("<svg") == len(result.settings.space)
    assert "leave-one-out" in page
    assert "nan" not in re.sub(r"[a-z]*nan[a-z]+|[a-z]+nan", "", text + page)
    data = json.loads((folder / "result.json").read_text())
    assert [trial["number"] for trial in data["trials"]] == [0, 1, 2]
    assert data["trials"][0]["outcomes"]["truck_roundabout"]["violations"] == 0


def test_figures_are_those_of_evaluate():
    """The whole of a drive, judged here, is what the evaluation says of it."""
    piece = DRIVES[0].excerpt(1.0, 3.0)
    driven = drive(MACHINE, piece, Tuning(algorithm="classical"), planner_hz=25.0)
    ours, theirs = judge(driven, most_eventful(piece, 0.0)), figures_of(driven)
    assert ours.nrmse == theirs.nrmse_xy
    assert ours.incongruence_peak == pytest.approx(theirs.comfort.rating_peak, rel=1e-12)
    assert ours.tilt_p99 == theirs.comfort.tilt_rate_p99
    assert ours.rmse_heave == theirs.axis("f_z").rmse


def test_standing_still_is_one_and_half_of_it_wanted_is_judged_as_such():
    whole = most_eventful(DRIVES[0], 0.0)
    still = judge(no_motion(MACHINE, DRIVES[0], 0.6), whole)
    assert still.nrmse == pytest.approx(1.0)
    assert still.incongruence == pytest.approx(1.0)
    assert still.sickness == 0.0
    half = judge(no_motion(MACHINE, DRIVES[0], 0.6), whole, ratio=0.5)
    assert half.rmse == pytest.approx(0.5 * still.rmse)
    late = judge(no_motion(MACHINE, DRIVES[0], 0.6), Stretch(DRIVES[0], 2.0, 6.0, 2.0))
    assert late.rmse != still.rmse


def test_searching_the_scale_never_changes_what_is_wanted(tmp_path):
    asked = ASKED | {"algorithm": "mpc", "trials": 4}
    result = tune(DRIVES, out=tmp_path, search_scale=True, **asked)
    assert {trial.values["scale"] for trial in result.trials} > {0.6}
    wanted = [
        trial.outcomes["truck_roundabout"].rmse / trial.outcomes["truck_roundabout"].nrmse
        for trial in result.trials
    ]
    assert wanted == pytest.approx([wanted[0]] * 4)
    assert "--search-scale" in result.command


def test_a_drive_without_force_is_refused(tmp_path):
    times = np.arange(300) * 0.01
    force = np.tile([0.0, 0.0, 9.81], (300, 1))
    silent = from_samples("silent", times, force, np.zeros((300, 3)), np.zeros(300))
    with pytest.raises(ConfigError, match=r"recording silent.*next to no horizontal force"):
        tune([silent, DRIVES[0]], out=tmp_path, **ASKED)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"algorithm": "classic"}, "unknown algorithm 'classic'"),
        ({"criterion": "best"}, "--criterion: unknown 'best'"),
        ({"trials": 1}, "--trials: 1 is out of range"),
        ({"refine": -1}, "--refine"),
        ({"excerpt": 0.5}, "--excerpt: 0.5 s"),
        ({"excerpt": float("nan")}, "--excerpt"),
        ({"planner_hz": 500.0}, "--planner-rate: 500 Hz"),
        ({"scale": 0.0}, "--scale"),
        ({"jobs": -1}, "--jobs"),
    ],
)
def test_wrong_arguments_are_refused(change, message, tmp_path):
    with pytest.raises(ConfigError, match=message):
        tune(DRIVES, out=tmp_path, **(ASKED | change))


def test_out_must_be_a_folder(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigError, match="--out"):
        tune(DRIVES, out=tmp_path / "file", **ASKED)


def test_command_line(tmp_path):
    paths = []
    for name, start in (("truck_brake_accel", 4001), ("truck_roundabout", 5501)):
        lines = (RECORDINGS / f"{name}.csv").read_text().splitlines()
        path = tmp_path / f"{name}.csv"
        path.write_text("\n".join([lines[0], *lines[start : start + 120]]) + "\n")
        paths.append(str(path))
    out = tmp_path / "out"
    options = ["--algorithm", "classical", "--trials", "2", "--excerpt", "1", "--planner-rate",
               "25", "--head", "0,0,0.7", "--out", str(out)]  # fmt: skip
    ran = CliRunner().invoke(app, ["tune", *paths, *options], catch_exceptions=False)
    assert ran.exit_code == 0
    assert "rmse on recordings not looked at" in ran.output
    assert "--head 0,0,0.7" in (out / "report.txt").read_text()
    refused = CliRunner().invoke(app, ["tune", *paths, *options, "--head", "up"])
    assert isinstance(refused.exception, ConfigError)
    too_far = CliRunner().invoke(app, ["tune", *paths, *options, "--head", "0,0,5"])
    assert "each at most 3" in str(too_far.exception)
