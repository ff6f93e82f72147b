"""Reading recordings: what is shipped is sound, what is wrong is named by line and column."""

import pytest
from motion_clients import RecordingError, read_recording, recording_names, recording_path

HEADER = "t,ax,ay,az,p,q,r,v,roll,pitch\n"
ROW = "0.00,1,2,3,4,5,6,7,8,9\n"
NEXT = "0.01,1,2,3,4,5,6,7,8,9\n"


def write(tmp_path, text):
    path = tmp_path / "drive.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_shipped_recordings_are_read():
    assert len(recording_names()) == 7
    for name in recording_names():
        recording = read_recording(recording_path(name))
        assert recording.period == pytest.approx(0.01)
        assert recording.duration > 39.0
        assert recording_path(f"{name}.csv") == recording.path


def test_unknown_recording_is_refused_with_the_known_ones():
    with pytest.raises(RecordingError, match="truck_brake_accel"):
        recording_path("no_such_drive")


def test_columns_are_found_by_name_in_any_order(tmp_path):
    header = "\ufeffpitch,note,t,ax,ay,az,p,q,r,v, roll\n"
    text = header + "9,x,0,1,2,3,4,5,6,7,8\n\n9,y,1,1,2,3,4,5,6,7,8\n"
    recording = read_recording(write(tmp_path, text))
    first = recording.samples[0]
    assert (first.time, first.acceleration, first.rates) == (0.0, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0))
    assert (first.speed, first.attitude) == (7.0, (8.0, 9.0))
    assert recording.duration == recording.period == 1.0
    assert [recording.index_at(t) for t in (-1.0, 0.0, 0.9, 1.0, 2.0)] == [0, 0, 0, 1, 1]


@pytest.mark.parametrize(
    ("text", "line", "column"),
    [
        ("", 1, "t"),
        (HEADER.replace("az", "up") + ROW + NEXT, 1, "az"),
        (HEADER.replace("az", "ax") + ROW + NEXT, 1, "ax"),
        (HEADER + ROW + "0.01,1,2\n", 3, None),
        (HEADER + ROW + NEXT.replace("4", "four"), 3, "p"),
        (HEADER + ROW + NEXT.replace("7", "nan"), 3, "v"),
        (HEADER + ROW + NEXT.replace("7", ""), 3, "v"),
        (HEADER + ROW + ROW, 3, "t"),
        (HEADER + ROW, None, None),
        (b"\xff\xfe\x00", None, None),
    ],
)
def test_fault_is_named_by_line_and_column(tmp_path, text, line, column):
    path = write(tmp_path, text)
    with pytest.raises(RecordingError) as refusal:
        read_recording(path)
    assert (refusal.value.path, refusal.value.line, refusal.value.column) == (path, line, column)
    assert str(path) in str(refusal.value)


def test_missing_file_is_named(tmp_path):
    with pytest.raises(RecordingError, match=r"nothing\.csv"):
        read_recording(tmp_path / "nothing.csv")
