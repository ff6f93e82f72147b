"""Comparing over a folder: every line, means, resuming, files that hold no NaN."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from own_hexapod import RECORDINGS

from motionserver.cueing.tuning import Tuning
from motionserver.errors import ConfigError
from motionserver.evaluate.compare import command, run
from motionserver.evaluate.compare.command import compare
from motionserver.evaluate.compare.contenders import Task, contenders
from motionserver.evaluate.compare.table import COLUMNS, RATIO, Block, Line, blocks
from motionserver.evaluate.compare.worker_share import forget_share, share_of, tell_share
from motionserver.evaluate.disturbance import Disturbance
from motionserver.evaluate.options import EvaluateOptions
from motionserver.settings.machine import load_machine
from motionserver.settings.tuning import default_for

MACHINE = load_machine("t2-compact")
OPTIONS = EvaluateOptions("classical", rate=250.0, jobs=1, disturb=True, seed=3)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Half a second of two drives."""
    out = tmp_path_factory.mktemp("recordings")
    for name in ("truck_brake_accel", "truck_roundabout"):
        lines = (RECORDINGS / f"{name}.csv").read_text().splitlines()
        (out / f"{name}.csv").write_text("\n".join([lines[0], *lines[4200:4251]]) + "\n")
    return out


@pytest.fixture(scope="module")
def written(folder, tmp_path_factory):
    out = tmp_path_factory.mktemp("out")
    assert compare(folder, out, OPTIONS) == 0
    return out


def test_every_contender_is_in_text_json_and_page(written):
    data = json.loads((written / "compare.json").read_text())
    assert data["schema"] == "motionserver-comparison-1"
    assert data["contenders"] == ["classical", "yardstick", "hindsight", "no motion"]
    assert list(data["table"]) == [
        "mean of 2 recordings",
        "truck_brake_accel",
        "truck_roundabout",
    ]
    still = data["table"]["truck_roundabout"]["no motion"]
    assert still["nRMSE xy"] == pytest.approx(1.0)
    assert still["corr"] is None
    hindsight = data["table"]["truck_roundabout"]["hindsight"]
    assert hindsight[RATIO] == 1.0
    assert data["table"]["mean of 2 recordings"]["classical"]["broken"] == 0
    assert data["failed"] == []
    text, page = (written / "compare.txt").read_text(), (written / "compare.html").read_text()
    for label in data["contenders"]:
        assert label in text
        assert label in page
    assert "seed 3" in text
    assert "hindsight: classical washout with gain and corners chosen" in text
    assert not re.search(r"(?:src|href)\s*=|https?://|@import|url\(", page)
    assert "NaN" not in page + text
    assert page.count("<svg") == 3 + 2


def test_a_second_run_drives_nothing(written, folder, monkeypatch, capsys):
    before = (written / "compare.json").read_text()
    monkeypatch.setattr(run, "drive_task", None)
    assert compare(folder, written, OPTIONS) == 0
    assert "8 drives, 8 of them known already" in capsys.readouterr().err
    assert (written / "compare.json").read_text() == before


def test_a_broken_result_is_driven_again(written, folder, capsys):
    kept = sorted((written / "drives").glob("*.json"))[0]
    whole = json.loads(kept.read_text())["figures"]
    kept.write_text('{"half')
    compare(folder, written, OPTIONS)
    assert "7 of them known already" in capsys.readouterr().err
    assert json.loads(kept.read_text())["figures"]["nrmse_xy"] == whole["nrmse_xy"]


def test_one_failure_does_not_take_the_others(folder, tmp_path, monkeypatch):
    real = run.drive_task

    def breaks(task):
        if task.contender.name == "classical":
            raise ArithmeticError("no root")
        return real(task)

    monkeypatch.setattr(run, "drive_task", breaks)
    single = tmp_path / "one"
    single.mkdir()
    name = "truck_roundabout.csv"
    (single / name).write_text((folder / name).read_text())
    assert compare(single, tmp_path, OPTIONS) == 1
    data = json.loads((tmp_path / "compare.json").read_text())
    assert data["failed"] == ["truck_roundabout: classical"]
    assert "FAILED: truck_roundabout: classical" in (tmp_path / "compare.txt").read_text()


def test_ways_of_an_algorithm_that_predicts():
    entered = contenders(["thondel2014", "classical"], Tuning(), 2.0, None)
    assert [each.label for each in entered] == [
        "thondel2014 (ar)",
        "thondel2014 (constant)",
        "thondel2014 (told 2 s ahead)",
        "classical",
        "yardstick",
        "hindsight",
        "no motion",
    ]
    constant = contenders(["thondel2014"], Tuning(reference="constant"), 4.0, None)
    assert [each.label for each in constant[:2]] == [
        "thondel2014 (constant)",
        "thondel2014 (told 4 s ahead)",
    ]


def test_held_out_each_recording_has_the_tunables_chosen_without_it(folder, tmp_path, monkeypatch):
    chosen = {
        "truck_brake_accel": {"gain": 0.4},
        "truck_roundabout": {"gain": 0.9},
    }
    result = tmp_path / "result.json"
    folds = {name: {"trial": 1, "values": values} for name, values in chosen.items()}
    base = default_for(MACHINE).model_dump()
    result.write_text(json.dumps({"schema": "motionserver-tuning-1", "base": base, "folds": folds}))
    seen = []
    monkeypatch.setattr(
        command, "run_tasks", lambda tasks, *_: seen.extend(tasks) or [None] * len(tasks)
    )
    with pytest.raises(ConfigError, match="every drive failed"):
        compare(folder, tmp_path, replace(OPTIONS, held_out=result, tilt_rate="6"))
    gains = {
        (task.recording.stem, task.contender.label): task.contender.tuning.gain
        for task in seen
        if task.contender.way
    }
    assert gains == {
        ("truck_brake_accel", "classical (tuned on the others)"): 0.4,
        ("truck_roundabout", "classical (tuned on the others)"): 0.9,
    }
    assert {task.contender.tuning.tilt_rate for task in seen} == {np.radians(6.0)}
    # rivals are what they are without
    plain = contenders(["classical"], replace(Tuning(), tilt_rate=np.radians(6.0)), 2.0, None)
    assert seen[1].contender.tuning.gain == plain[1].tuning.gain

    del folds["truck_roundabout"]
    result.write_text(json.dumps({"schema": "motionserver-tuning-1", "base": base, "folds": folds}))
    with pytest.raises(ConfigError, match="without truck_roundabout"):
        compare(folder, tmp_path, replace(OPTIONS, held_out=result))


def test_the_key_knows_what_matters():
    path = RECORDINGS / "truck_roundabout.csv"
    tuning = Tuning()

    def key(index=0, machine=MACHINE, file=path, rate=500.0, trouble=None, **changes):
        entered = contenders(["thondel2014"], replace(tuning, **changes), 2.0, trouble)
        return Task(file, entered[index], machine, rate, 100.0).key()

    changed = [
        key(),
        key(1),
        key(2),
        key(machine=MACHINE.with_head([0.0, 0.0, 0.7])),
        key(file=RECORDINGS / "truck_puncture.csv"),
        key(rate=250.0),
        key(trouble=Disturbance(1)),
        key(trouble=Disturbance(2)),
        key(weight_force=2.0),
    ]
    assert len(set(changed)) == len(changed)
    assert key() == key()
    # the optimiser's weights are nothing to a rival, scale and tilt rate are
    assert key(-1, weight_force=2.0) == key(-1)
    assert key(-2, scale=0.5) != key(-2)
    assert key(-2, tilt_rate=0.1) != key(-2)


def test_means_leave_out_what_is_not_there():
    count = len(COLUMNS)

    def result(name, label, rmse):
        axes = [{"axis": "f_z", "nrmse": None}]
        figures = {
            "rmse_xy": rmse,
            "nrmse_xy": rmse,
            "xy": {"correlation": None, "onset": 0.5, "perceived": 0.5},
            "axes": axes,
            "comfort": {"rating_peak": 1.0, "tilt_rate_p99": 0.1, "tilt_share": 0.5},
            "workspace": {"violations": 2},
            "planning": None,
        }
        return {"recording": name, "contender": label, "figures": figures}

    found = blocks(
        [result("a", "mpc", 0.2), result("a", "hindsight", 0.4), result("b", "mpc", 0.6)]
    )
    mean = {c.head: v for c, v in zip(COLUMNS, found[0].lines[0].values, strict=True)}
    assert mean["nRMSE xy"] == pytest.approx(0.4)
    assert mean[RATIO] == 0.5
    assert mean["broken"] == 4
    assert mean["f_z"] is None
    assert mean["halved"] is None
    lines = (Line("one", (0.12341,) * count), Line("two", (0.12342,) * count))
    assert Block("same", lines).best(0) == set()


@pytest.mark.parametrize(
    ("change", "message"),
    [({"algorithm": "classic"}, "unknown 'classic'"), ({}, r"no \*\.csv in")],
)
def test_wrong_arguments_are_refused(change, message, folder, tmp_path):
    place = folder if change else Path(tmp_path)
    with pytest.raises(ConfigError, match=message):
        compare(place, tmp_path, replace(OPTIONS, **change))


def test_workers_tell_how_far_they_are(tmp_path):
    file = tmp_path / "abc.json"
    assert share_of(file) == 0.0
    for told, heard in ((0.25, 0.25), (7.0, 1.0)):
        tell_share(file, told)
        assert share_of(file) == heard
    (tmp_path / "abc.share").write_text("half")
    assert share_of(file) == 0.0
    forget_share(file)
    assert not list(tmp_path.iterdir())
