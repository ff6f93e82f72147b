"""Reading recordings: units, gravity, and complaints that name the place."""

import numpy as np
import pytest
from own_hexapod import RECORDINGS

from motionserver.errors import MotionServerError
from motionserver.evaluate.recording import COLUMNS, RecordingError, read_recording

HEADER = ",".join(COLUMNS)
GOOD = "0,0,0,0,0,0,0,0,0,0\n0.01,1,2,3,0.1,0.2,0.3,5,0,0\n"


def write(tmp_path, text):
    path = tmp_path / "drive.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_specific_force_contains_gravity_by_attitude(tmp_path):
    rolled, pitched = np.radians(10.0), np.radians(10.0)
    path = write(
        tmp_path,
        f"{HEADER}\n3,0,0,0,0,0,0,0,{rolled},0\n3.5,0,0,0,0,0,0,0,0,{pitched}\n4,1,2,3,0,0,0,7,0,0\n",
    )
    read = read_recording(path)
    assert read.name == "drive"
    assert read.times == pytest.approx([0.0, 0.5, 1.0])
    assert read.force[0] == pytest.approx([0.0, 1.7035, 9.6610], abs=1e-4)
    assert read.force[1] == pytest.approx([-1.7035, 0.0, 9.6610], abs=1e-4)
    assert read.force[2] == pytest.approx([1.0, 2.0, 12.81])
    assert read.speed[2] == 7.0


def test_columns_may_stand_in_any_order_beside_others(tmp_path):
    order = [*reversed(COLUMNS), "note"]
    row = dict.fromkeys(order, "0") | {"note": "hello"}
    lines = [",".join((row | {"t": str(t), "p": "0.25"})[name] for name in order) for t in (0, 1)]
    read = read_recording(write(tmp_path, "\ufeff" + ",".join(order) + "\n" + "\n".join(lines)))
    assert read.rates[:, 0] == pytest.approx([0.25, 0.25])


@pytest.mark.parametrize(
    ("text", "line", "column", "message"),
    [
        (f"{HEADER.replace('az', 'up')}\n{GOOD}", 1, "az", "0 times"),
        (f"{HEADER},t\n{GOOD}", 1, "t", "2 times"),
        (f"{HEADER}\n{GOOD}0.02,1,2,3,0.1,nonsense,0.3,5,0,0\n", 4, "q", "'nonsense'"),
        (f"{HEADER}\n{GOOD}0.02,inf,2,3,0.1,0,0.3,5,0,0\n", 4, "ax", "not a finite number"),
        (f"{HEADER}\n{GOOD}0.02,1,2\n", 4, None, "3 fields, the header names 10"),
        (f"{HEADER}\n{GOOD}0.01,1,2,3,0.1,0,0.3,5,0,0\n", 4, "t", "must increase"),
        (f"{HEADER}\n", None, None, "at least two"),
        ("", 1, "t", "0 times"),
    ],
)
def test_bad_file_is_refused_with_line_and_column(tmp_path, text, line, column, message):
    with pytest.raises(RecordingError, match=message) as caught:
        read_recording(write(tmp_path, text))
    assert caught.value.line == line
    assert caught.value.column == column
    assert "drive.csv" in str(caught.value)
    assert isinstance(caught.value, MotionServerError)


def test_missing_and_binary_files_are_refused(tmp_path):
    with pytest.raises(RecordingError, match="cannot be read"):
        read_recording(tmp_path / "nowhere.csv")
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x01")
    with pytest.raises(RecordingError, match="cannot be read"):
        read_recording(tmp_path / "binary.csv")


def test_excerpt_sets_its_clock_to_zero():
    whole = read_recording(RECORDINGS / "truck_brake_accel.csv")
    piece = whole.excerpt(40.0, 42.0)
    assert piece.times[0] == 0.0
    assert piece.duration == pytest.approx(2.0)
    assert np.array_equal(piece.force[0], whole.force[4000])
    with pytest.raises(ValueError, match="fewer than two samples"):
        whole.excerpt(100.0, 101.0)
