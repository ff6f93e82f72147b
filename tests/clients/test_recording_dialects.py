"""Recordings in any dialect: what is written by whatever program reads back equal."""

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from motion_clients import RecordingError, csv_text, read_recording
from motion_clients.recording import COLUMNS

G = 9.80665
UNITS = {
    "t": [("", 1.0), ("s", 1.0), ("ms", 1e-3)],
    "a": [("", 1.0), ("m/s^2", 1.0), ("m/s²", 1.0), ("m/s2", 1.0), ("g", G), ("m s^-2", 1.0)],
    "p": [("", 1.0), ("rad/s", 1.0), ("deg/s", 0.017453292519943295), ("°/s", 0.0174532925199433)],
    "v": [("", 1.0), ("m/s", 1.0), ("km/h", 1 / 3.6)],
    "roll": [("", 1.0), ("rad", 1.0), ("deg", 0.017453292519943295)],
}
KIND = dict(zip(COLUMNS, ("t", "a", "a", "a", "p", "p", "p", "v", "roll", "roll"), strict=True))
NUMBERS = st.floats(-30.0, 30.0).map(lambda x: round(x, 6))


@st.composite
def files(draw):
    """A table of SI values, and the same as text in some dialect."""
    count = draw(st.integers(2, 6))
    steps = draw(st.lists(st.floats(0.001, 5.0), min_size=count, max_size=count))
    rows, time = [], draw(st.floats(0.0, 1e4))
    for step in steps:
        time += step
        rows.append([time, *(draw(NUMBERS) for _ in COLUMNS[1:])])
    order = draw(st.permutations([*COLUMNS, "note"]))
    separator = draw(st.sampled_from([",", ";", "\t", "|", " "]))
    commas = separator != "," and draw(st.booleans())
    quoted = separator != " " and draw(st.booleans())
    style = draw(st.sampled_from(["[{}]", "({})", "/"])) if separator != " " else "[{}]"
    unit = {name: draw(st.sampled_from(UNITS[KIND[name]])) for name in COLUMNS}
    row_of_units = draw(st.booleans()) and any(text for text, _ in unit.values())
    upper = draw(st.booleans())

    def head(name):
        text = unit[name][0] if name in unit else ""
        told = name.upper() if upper else name
        if text and not row_of_units:
            told += f" / {text}" if style == "/" else " " + style.format(text)
        return told.replace(" ", "") if separator == " " else told

    def cell(name, value):
        if name == "note":
            return "x"
        text = repr(value / unit[name][1])
        return text.replace(".", ",") if commas else text

    def line(cells):
        cells = [f'"{c}"' for c in cells] if quoted else cells
        return separator.join(cells)

    lines = [line([head(name) for name in order])]
    if row_of_units:
        named = [f"[{unit[n][0]}]" if n in unit else "-" for n in order]
        lines.append(line([n.replace(" ", "") if separator == " " else n for n in named]))
    for row in rows:
        values = dict(zip(COLUMNS, row, strict=True))
        lines.append(line([cell(name, values.get(name)) for name in order]))
    for _ in range(draw(st.integers(0, 3))):
        remark = draw(st.sampled_from(["# logged by X, 1;2", "", "   ", "% rows: 5", "// end"]))
        lines.insert(draw(st.integers(0, len(lines))), remark)
    if draw(st.booleans()) and separator != " ":
        lines.insert(0, f"sep={separator}")
    if draw(st.booleans()):
        lines.append(separator * 3 if separator != " " else "")
    ends = draw(st.sampled_from(["\n", "\r\n", "\r"]))
    text = ends.join(lines) + draw(st.sampled_from(["", ends, ends * 2]))
    encoding = draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "cp1252"]))
    return rows, text, text.encode(encoding)


@settings(
    max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(files())
def test_recording_in_any_dialect_reads_back_equal(tmp_path, drawn):
    rows, text, data = drawn
    path = tmp_path / "drive.csv"
    path.write_bytes(data)
    read = read_recording(path)
    assert len(read.samples) == len(rows), text
    for sample, row in zip(read.samples, rows, strict=True):
        told = [sample.time, *sample.acceleration, *sample.rates, sample.speed, *sample.attitude]
        assert told == pytest.approx(row, rel=1e-9, abs=1e-9), text


HEADER = "t,ax,ay,az,p,q,r,v,roll,pitch\n"


def drive(tmp_path, text):
    path = tmp_path / "drive.csv"
    path.write_text(text, encoding="utf-8")
    return path


def table(rows, header=HEADER):
    return header + "".join(",".join(f"{x:.12g}" for x in row) + "\n" for row in rows)


def rows_of(seconds=4.0, step=0.02, **columns):
    """A drive that brakes and goes again; columns as functions of time, in SI."""
    out = []
    for k in range(round(seconds / step) + 1):
        t = k * step
        told = {"t": t, "ax": 2.0 if int(t) % 2 else -2.0, "v": 15.0}
        told.update({name: f(t) for name, f in columns.items()})
        out.append([told.get(name, 0.0) for name in COLUMNS])
    return out


def test_plain_drive_has_no_warning(tmp_path):
    assert read_recording(drive(tmp_path, table(rows_of()))).warnings == ()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"az": lambda t: 9.81}, ("az", "9.81", "gravity", "fx,fy,fz")),
        ({"az": lambda t: -9.79}, ("az", "-9.79", "gravity")),
        ({"az": lambda t: 1.0, "ax": lambda t: 0.2}, ("az", "gravity", "fx [g]")),
        ({"ax": lambda t: 0.2 if int(t) % 2 else -0.2}, ("in g?", "ax [g]")),
        ({"t": lambda t: 1000.0 * t}, ("in ms?", "t [ms]")),
        ({"t": lambda t: t if t < 2.0 else t + 10.0}, ("a gap", "10.02 s", "line 102")),
        ({"t": lambda t: 0.001 * t}, ("only 0.004 s long",)),
        ({"t": lambda t: 40.0 * t}, ("0.8 s apart", "20 Hz")),
        ({"roll": lambda t: 7.0}, ("in degrees?", "roll [deg]")),
        ({"r": lambda t: 25.0}, ("in deg/s?", "r [deg/s]")),
        ({"v": lambda t: 140.0}, ("in km/h?", "v [km/h]")),
    ],
)
def test_slip_is_one_warning_line_with_the_fix(tmp_path, change, words):
    (line,) = read_recording(drive(tmp_path, table(rows_of(**change)))).warnings
    assert all(word in line for word in words), line
    assert "\n" not in line


@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (1 / G, ("times as fast", "in g?")),
        (1 / 3.6, ("times as fast", "km/h")),
        (-1.0, ("forward",)),
    ],
)
def test_speed_tells_the_unit_of_acceleration(tmp_path, factor, words):
    # 2 s of 3 m/s2 either way: the speed goes 15, 21, 15 ...; here ax is that times a factor
    def speed(t):
        half, rest = divmod(round(t, 6), 2.0)
        return 15.0 + 3.0 * rest if int(half) % 2 == 0 else 21.0 - 3.0 * rest

    def forward(t):
        return factor * (3.0 if int(round(t, 6) / 2.0) % 2 == 0 else -3.0)

    rows = rows_of(20.0, ax=forward, v=speed)
    (line,) = read_recording(drive(tmp_path, table(rows))).warnings
    assert all(word in line for word in words), line


def test_specific_force_is_taken_and_gravity_goes_by_attitude(tmp_path):
    header = HEADER.replace("ax,ay,az", "fx,fy,fz")
    path = drive(
        tmp_path, table([[0, 3, 0, 9.81, 0, 0, 0, 5, 0, 0], [9, 0, 0, 9.81] + [0] * 6], header)
    )
    read = read_recording(path)
    assert read.samples[0].acceleration == pytest.approx((3.0, 0.0, 0.0))
    # nose down by 30 deg at rest: the accelerometer reads -g/2 forward, 0.866 g up
    tilted = [[t, -4.905, 0, 8.49571, 0, 0, 0, 5, 0, 0.5235988] for t in (0, 9)]
    read = read_recording(drive(tmp_path, table(tilted, header)))
    assert read.samples[0].acceleration == pytest.approx((0.0, 0.0, 0.0), abs=1e-4)


@pytest.mark.parametrize(
    ("value", "words"),
    [(0.0, "name the columns ax,ay,az"), (1.0, "fx [g]"), (-9.81, "z points down")],
)
def test_force_without_gravity_in_g_or_upside_down_is_told(tmp_path, value, words):
    header = HEADER.replace("ax,ay,az", "fx,fy,fz")
    rows = rows_of(az=lambda t: value)
    found = read_recording(drive(tmp_path, table(rows, header))).warnings
    assert words in " ".join(found)


@pytest.mark.parametrize("missing", [("roll", "pitch"), ("roll",), ("pitch",)])
def test_missing_attitude_is_level_and_told(tmp_path, missing):
    names = [name for name in COLUMNS if name not in missing]
    rows = [
        [value for name, value in zip(COLUMNS, row, strict=True) if name in names]
        for row in rows_of(roll=lambda t: 0.1, pitch=lambda t: 0.2)
    ]
    read = read_recording(drive(tmp_path, table(rows, ",".join(names) + "\n")))
    (line,) = read.warnings
    assert " and ".join(missing) in line
    kept = {"roll": 0.1, "pitch": 0.2} | dict.fromkeys(missing, 0.0)
    assert read.samples[3].attitude == (kept["roll"], kept["pitch"])


@pytest.mark.parametrize(
    ("times", "line", "words"),
    [
        (["0", "0.02", "0.04", "0.02"], 5, "does not come after"),
        (["0", "0.02", "0.02"], 4, "does not come after"),
        (["1750000000", "1750000000.02", "1750000000.04"], 2, "too few digits"),
        (["1.75e9", "1.75e9"], 3, "does not come after"),
        (["1750000000000", "1750000000001"], 2, "too few digits"),
    ],
)
def test_times_that_cannot_be_are_refused_with_the_line(tmp_path, times, line, words):
    text = HEADER + "".join(f"{t},1,0,0,0,0,0,9,0,0\n" for t in times)
    with pytest.raises(RecordingError, match=words) as refused:
        read_recording(drive(tmp_path, text))
    assert (refused.value.line, refused.value.column) == (line, "t")


def test_epoch_with_all_digits_is_read(tmp_path):
    text = HEADER + "".join(f"175000000{k}.{k:06d},2,0,0,0,0,0,9,0,0\n" for k in range(9))
    assert len(read_recording(drive(tmp_path, text)).samples) == 9


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (HEADER.replace("ax", "ax [furlong]") + "0,1,0,0,0,0,0,9,0,0\n", "furlong.*known are m/s2"),
        (HEADER + "0,02,1,0,0,0,0,0,9,0,0\n", "11 fields.*semicolons"),
        (
            HEADER.replace(",", ";") + "0,1;1;0;0;0;0;0;9;0;0\n0,2;1.5;0;0;0;0;0;9;0;0\n",
            "decimal p",
        ),
        (HEADER + "0,1_0,0,0,0,0,0,9,0,0\n", "not a finite number"),
    ],
)
def test_what_cannot_be_read_says_what_to_do(tmp_path, text, words):
    with pytest.raises(RecordingError, match=words):
        read_recording(drive(tmp_path, text))


def test_names_in_a_remark_as_numpy_writes_them_are_found(tmp_path):
    numpy = pytest.importorskip("numpy")
    path = tmp_path / "drive.csv"
    numpy.savetxt(path, rows_of(), delimiter=",", header=HEADER.strip())
    assert read_recording(path).samples[1].acceleration == (-2.0, 0.0, 0.0)
    numpy.savetxt(path, rows_of(), header=HEADER.strip().replace(",", " "))
    assert read_recording(path).samples[1].acceleration == (-2.0, 0.0, 0.0)


def test_what_is_no_file_of_bounded_size_is_refused(tmp_path):
    pipe = tmp_path / "pipe.csv"
    os.mkfifo(pipe)
    for path in (pipe, tmp_path, Path("/dev/zero")):
        with pytest.raises(RecordingError, match="cannot be read as CSV text"):
            read_recording(path)
    path = drive(tmp_path, table(rows_of()))
    with pytest.raises(RecordingError, match="cut the drive"):
        csv_text.read_text(path, 10)


def test_what_an_earlier_version_recorded_says_that_it_holds_no_drive(tmp_path):
    path = drive(tmp_path, "time_s,state,surge_m,algorithm\n0.0,RUN,0.0,mpc\n0.1,RUN,0.0,mpc\n")
    with pytest.raises(RecordingError, match="earlier version of `motionserver record`"):
        read_recording(path)
