"""Fitting a predictor from the command line: a file that loads, and errors on what was left out."""

import re
from dataclasses import replace

import numpy as np
import pytest
from own_hexapod import RECORDINGS
from typer.testing import CliRunner

from motionserver.cli.commands import app
from motionserver.cueing.predictor import load
from motionserver.errors import ConfigError
from motionserver.evaluate.recording import read_recording
from motionserver.evaluate.tune.predictor import tune_predictor, worth

DRIVES = [
    replace(read_recording(RECORDINGS / f"{name}.csv").excerpt(10.0, 26.0), name=name)
    for name in ("truck_brake_accel", "truck_roundabout", "truck_lanechange_slalom")
]


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    folder = tmp_path_factory.mktemp("predictor")
    return tune_predictor(DRIVES, "my-truck", folder), folder


def test_file_loads_as_what_was_fitted(fitted):
    predictor, folder = fitted
    loaded = load(folder / "my-truck.json")
    assert loaded.name == "my-truck"
    assert loaded.weights == pytest.approx(predictor.weights, abs=1e-6)
    assert loaded.provenance == predictor.provenance
    assert "motionserver tune --predictor my-truck" in str(loaded.provenance)


def test_report_shows_every_drive_left_out(fitted):
    predictor, folder = fitted
    text = (folder / "my-truck-report.txt").read_text()
    page = (folder / "my-truck-report.html").read_text()
    for drive in DRIVES:
        for axis in ("surge", "sway"):
            errors = predictor.provenance["left_out"][drive.name][axis]["learned"]
            assert f"{np.mean(errors):.3f}" in text
        assert drive.name in text
        assert drive.name in page
    assert all(line in text for line in worth(predictor))
    assert not re.search(r"(?:src|href)\s*=|https?://|@import|url\(", page)


def test_worth_is_read_from_the_errors_left_out(fitted):
    predictor, _ = fitted
    parts = {
        "a": {axis: {"ar": [0.5, 0.7], "learned": [0.4, 0.5]} for axis in ("surge", "sway")},
        "b": {axis: {"ar": [0.4, 0.4], "learned": [0.4, 0.5]} for axis in ("surge", "sway")},
    }
    told = worth(replace(predictor, provenance={"left_out": parts}))[0]
    assert told.startswith("surge: relative error on drives left out 0.450, without")
    assert "0.500 (+10.0 % saved), better on 1 of 2" in told
    for part in parts.values():
        for axis in part.values():
            axis["learned"] = axis["ar"]
    assert "there is none" in worth(replace(predictor, provenance={"left_out": parts}))[1]


def test_refusals(tmp_path):
    with pytest.raises(ConfigError, match="--predictor: 'My truck' is no name"):
        tune_predictor(DRIVES, "My truck", tmp_path)
    with pytest.raises(ConfigError, match=r"RECORDINGS.*too short"):
        tune_predictor([DRIVES[0].excerpt(0.0, 5.0), DRIVES[1]], "short", tmp_path)


def test_command_line(tmp_path):
    source = RECORDINGS / "truck_brake_accel.csv"
    out = tmp_path / "out"
    ran = CliRunner().invoke(
        app, ["tune", str(source), "--predictor", "one", "--out", str(out)], catch_exceptions=False
    )
    assert ran.exit_code == 0
    assert "surge:" in ran.output
    assert sorted(path.name for path in out.iterdir()) == [
        "one-report.html", "one-report.txt", "one.json",
    ]  # fmt: skip
