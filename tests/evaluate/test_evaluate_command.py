"""The command: files, rivals, refusals."""

import json
import re

import numpy as np
import pytest
from own_hexapod import NO_VIOLATIONS, RECORDINGS, own_legs, own_violations

from motionserver.cueing.tuning import Tuning
from motionserver.errors import ConfigError
from motionserver.evaluate.command import evaluate
from motionserver.evaluate.lockstep import drive
from motionserver.evaluate.metrics.figures import rmse_xy
from motionserver.evaluate.page import to_html
from motionserver.evaluate.recording import RecordingError, read_recording
from motionserver.evaluate.report import to_text
from motionserver.evaluate.result import to_json
from motionserver.evaluate.rows import sections
from motionserver.evaluate.yardstick import COARSE, find_yardstick
from motionserver.settings.machine import load_machine

MACHINE = load_machine("t2-compact")


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """Two seconds of the emergency stop as a file."""
    lines = (RECORDINGS / "truck_brake_accel.csv").read_text().splitlines()
    path = tmp_path_factory.mktemp("short") / "stop.csv"
    path.write_text("\n".join([lines[0], *lines[4001:4202]]) + "\n")
    return path


@pytest.fixture(scope="module")
def found(short):
    folder = short.parent
    return evaluate(
        short,
        ["thondel2014"],
        MACHINE,
        0.6,
        250.0,
        folder / "setpoints.csv",
        folder / "figures.json",
        folder / "page.html",
        jobs=1,
        quiet=True,
    )


def test_rivals_are_always_in_the_table(found):
    names = ["thondel2014", "yardstick", "hindsight", "no motion"]
    assert [figures.name for figures in found.figures] == names
    assert [driven.name for driven in found.drives] == names
    assert found.violations == 0
    assert found.rejected == 0
    with pytest.raises(KeyError):
        found.of("classical")


def test_setpoints_have_the_stated_columns_and_legs(found, short):
    lines = (short.parent / "setpoints.csv").read_text().splitlines()
    assert lines[0] == "t,surge,sway,heave,roll,pitch,yaw,leg1,leg2,leg3,leg4,leg5,leg6"
    table = np.array([[float(field) for field in line.split(",")] for line in lines[1:]])
    assert len(table) == 501
    assert table[:, 0] == pytest.approx(np.arange(501) / 250.0)
    assert table[:, 7:] == pytest.approx(own_legs(table[:, 1:7]), abs=1e-11)
    assert own_violations(table[:, 1:7], 250.0) == NO_VIOLATIONS
    written = re.findall(r"[1-9]\d*|\.0*([1-9]\d*)", lines[-1])
    assert written
    assert max(len(re.sub(r"e.*|[-.]", "", f).lstrip("0")) for f in lines[-1].split(",")) == 12


def test_json_holds_every_figure(found, short):
    data = json.loads((short.parent / "figures.json").read_text())
    assert data["schema"] == "motionserver-evaluation-1"
    assert data["machine"] == {"name": "t2-compact", "digest": MACHINE.digest}
    assert data["violations"] == 0
    assert data["scale"] == 0.6
    assert [result["name"] for result in data["results"]] == [f.name for f in found.figures]
    first = data["results"][0]
    assert first["rmse_xy"] == found.figures[0].rmse_xy
    assert [axis["axis"] for axis in first["axes"]] == ["f_x", "f_y", "f_z", "w_x", "w_y", "w_z"]
    assert data["results"][3]["planning"] is None
    assert data["yardstick"]["gain"] == found.yardstick.gain
    assert data["hindsight"]["gain"] == found.hindsight.washout.gain
    assert len(data["hindsight"]["screened"]) == 63
    assert data["disturbance"] is None
    assert "NaN" not in to_json(found)


def test_page_needs_nothing_but_itself(found, short):
    page = (short.parent / "page.html").read_text()
    assert page == to_html(found)
    assert not re.search(r"(?:src|href)\s*=|https?://|@import|url\(", page)
    assert page.count("<svg") == 4
    assert MACHINE.digest in page
    assert "nan" not in re.sub(r"[a-z]*nan[a-z]+|[a-z]+nan", "", page)


def test_text_is_aligned_and_names_the_rule(found):
    text = to_text(found)
    assert "gain in (0, 1] of least RMSE(x, y)" in text
    assert "as it must be" in text
    assert "hindsight: classical washout with gain and corners chosen" in text
    assert f"machine t2-compact ({MACHINE.digest})" in text
    rows = [row for section in sections(found) for row in section.rows]
    assert all(len(row.cells) == 4 for row in rows)
    lines = [line for line in text.splitlines() if line.startswith("  ") and "nRMSE" in line]
    assert len({len(line) for line in lines}) == 1


def test_yardstick_is_the_best_of_all_tried_and_reruns_the_same(found, short):
    tried = dict(found.yardstick.tried)
    assert set(COARSE) <= set(tried)
    assert tried[found.yardstick.gain] == min(tried.values())
    assert rmse_xy(found.yardstick.drive) == tried[found.yardstick.gain]
    again = drive(
        MACHINE,
        read_recording(short),
        Tuning(algorithm="classical", scale=0.6, gain=found.yardstick.gain),
        rate=250.0,
    )
    assert again.pose.tobytes() == found.yardstick.drive.pose.tobytes()


def test_yardstick_does_not_depend_on_the_number_of_processes(short):
    recording = read_recording(short).excerpt(0.0, 0.3)
    one, two = (find_yardstick(MACHINE, recording, Tuning(), jobs=jobs) for jobs in (1, 2))
    assert one.tried == two.tried
    assert one.drive.pose.tobytes() == two.drive.pose.tobytes()


def test_progress_goes_to_standard_error(short, tmp_path, capsys):
    lines = short.read_text().splitlines()
    piece = tmp_path / "piece.csv"
    piece.write_text("\n".join(lines[:32]))
    evaluate(piece, ["classical"], MACHINE, 0.6)
    out, err = capsys.readouterr()
    assert out == ""
    assert "piece: classical: 0.3 s driven" in err
    assert "piece: yardstick: gain" in err


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"algorithms": ["classic"]}, "unknown algorithm 'classic'.*Allowed: "),
        ({"algorithms": []}, "0 given"),
        ({"algorithms": ["classical", "classical"]}, "may stand once"),
        ({"scale": 0.0}, "--scale: 0 is out of range"),
        ({"scale": float("nan")}, "--scale"),
        ({"rate": 5.0}, "--rate: 5 Hz"),
        ({"planner_hz": 1000.0}, "--planner-rate"),
        ({"preview": 5.0}, "--preview: 5 s"),
        ({"json_out": "nowhere/figures.json"}, "--json nowhere.*no file in an existing folder"),
        ({"html_out": "."}, "--html"),
        ({"algorithms": ["classical", "thondel2014"], "setpoints": "x.csv"}, "--setpoints"),
    ],
)
def test_wrong_arguments_are_refused_before_anything_is_read(change, message):
    with pytest.raises(ConfigError, match=message):
        evaluate("nowhere.csv", machine=MACHINE, **change)


def test_missing_recording_is_refused():
    with pytest.raises(RecordingError, match=r"nowhere\.csv"):
        evaluate("nowhere.csv", machine=MACHINE)
