"""Recorded drives: CSV files of what a vehicle did, read with exact complaints.

Needed are ``t``, either ``ax, ay, az`` (kinematic acceleration, 0 at rest) or ``fx, fy, fz``
(specific force, +9.81 in z at rest), ``p, q, r`` and ``v``; ``roll, pitch`` are zero where they are
missing. What `motionserver record` writes holds them beside what the platform did, and `EXTRAS`;
there a row without ``t`` is one of the platform alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, sin
from pathlib import Path
from typing import Final

from motion_protocol import Vector3

from .csv_table import Table, check_lengths, number, read_table
from .csv_text import RecordingError
from .drive_samples import PreviewSample, RecordedSample, Recording
from .recording_checks import (
    acceleration_warnings,
    angle_warnings,
    time_warnings,
    unit_warnings,
)
from .recording_extras import EXTRAS, OWN, Extras, changes

__all__ = [
    "COLUMNS",
    "EXTRAS",
    "PreviewSample",
    "RecordedSample",
    "Recording",
    "RecordingError",
    "read_recording",
    "recording_names",
    "recording_path",
]

COLUMNS: Final = ("t", "ax", "ay", "az", "p", "q", "r", "v", "roll", "pitch")
"""Columns of a recording, in any order; further ones but `FORCE` and `EXTRAS` are ignored."""
FORCE: Final = ("fx", "fy", "fz")
"""May stand in place of ax, ay, az: specific force."""
GRAVITY: Final = 9.81
"""As the server counts it [m/s^2]."""
EPOCH: Final = 1e8
"""Later times count from 1970 or the like [s]."""

_RECORDINGS: Final = Path(__file__).parent / "recordings"
_COARSE: Final = 0.1  # of a step: a written time that is coarser says too little


def recording_names() -> tuple[str, ...]:
    """Names of the recordings that come with the package."""
    return tuple(sorted(path.stem for path in _RECORDINGS.glob("*.csv")))


def recording_path(name: str) -> Path:
    """Find a recording that comes with the package, with or without `.csv`.

    Raises:
        RecordingError: There is none of that name.
    """
    stem = name.removesuffix(".csv")
    if stem not in recording_names():
        raise RecordingError(
            Path(name), f"no such recording; there are {', '.join(recording_names())}"
        )
    return _RECORDINGS / f"{stem}.csv"


def read_recording(path: str | Path) -> Recording:
    """Read a CSV file of any usual dialect, see `csv_table`.

    Raises:
        RecordingError: The file cannot be read, or says what no drive can be; file, line and
            column are named.
    """
    table = read_table(Path(path), (*COLUMNS, *FORCE))
    is_own = table.has(*OWN)
    if is_own and not table.has("t"):
        raise RecordingError(
            table.path,
            "holds what the platform did and not what the vehicle did: written by an earlier "
            "version of `motionserver record`; record again",
            line=table.header_line,
        )
    all_rows = table.rows
    if is_own and table.is_cut and all_rows and len(all_rows[-1][1]) != len(table.names):
        # cut off by a full disk or a power cut
        all_rows = all_rows[:-1]
    columns, warnings = _columns(table)
    check_lengths(table, all_rows)
    rows = all_rows
    if is_own:
        place = table.index("t")
        rows = tuple(row for row in all_rows if row[1][place].strip())
    values = table.numbers(columns, rows)
    missing = [name for name in COLUMNS[8:] if name not in columns]
    if missing:
        values = [_levelled(row, columns) for row in values]
    if len(rows) < 2:
        raise RecordingError(table.path, f"has {len(rows)} samples; a recording needs at least two")
    lines = [line for line, _ in rows]
    _check_times(table, rows, [row[0] for row in values])
    warnings += _warnings(table, values, columns, lines)
    extras = Extras(table)
    samples = tuple(
        _sample(value, columns[1] == "fx", extras, line, row)
        for value, (line, row) in zip(values, rows, strict=True)
    )
    states = changes(table, all_rows, "state") if is_own else ()
    settings = changes(table, all_rows, "settings") if is_own else ()
    return Recording(table.path, samples, tuple(warnings), states, settings)


def _columns(table: Table) -> tuple[tuple[str, ...], list[str]]:
    """Columns to read, and what is to be said of them.

    Raises:
        RecordingError: One is missing, or there more than once.
    """
    warnings = []
    three = COLUMNS[1:4]
    if any(name in table.names for name in FORCE):
        if table.has(*three):
            warnings.append("columns fx, fy, fz: left out, ax, ay, az are there as well")
        else:
            three = FORCE
    attitude = [name for name in COLUMNS[8:] if name in table.names]
    missing = [name for name in COLUMNS[8:] if name not in table.names]
    if missing:
        warnings.append(
            f"column {' and '.join(missing)} missing: taken as 0, a level road; add "
            f"{'it' if len(missing) == 1 else 'them'} in rad, or in degrees as "
            f"{' and '.join(f'{name} [deg]' for name in missing)}"
        )
    columns = ("t", *three, *COLUMNS[4:8], *attitude)
    for column in columns:
        table.index(column)
    return columns, warnings


def _levelled(row: list[float], columns: Sequence[str]) -> list[float]:
    """The row with roll and pitch 0 where they are missing."""
    told = dict(zip(columns[8:], row[8:], strict=True))
    return [*row[:8], *(told.get(name, 0.0) for name in COLUMNS[8:])]


def _warnings(
    table: Table, values: list[list[float]], names: tuple[str, ...], lines: list[int]
) -> list[str]:
    t, *rest = (list(column) for column in zip(*values, strict=True))
    three, rates, speeds, attitude = rest[0:3], rest[3:6], rest[6], rest[7:9]
    is_force = names[1] == "fx"
    has_unit = bool(table.unit(names[1]))
    out = time_warnings(t, lines, bool(table.unit("t")))
    found = acceleration_warnings(three, speeds, names[1:4], is_force)
    if not found and not (out and "t [ms]" in out[0]):
        kinematic = three
        if is_force:
            pairs = zip(values, strict=True)
            kinematic = [list(c) for c in zip(*(_kinematic(v) for (v,) in pairs), strict=True)]
        found = unit_warnings(t, kinematic[0], kinematic[1:], speeds, has_unit)
    turning = bool(table.unit("p"))
    leaning = any(table.unit(name) for name in COLUMNS[8:] if name in table.names)
    return [*out, *found, *angle_warnings(rates, attitude, (turning, leaning))]


def _check_times(
    table: Table, rows: Sequence[tuple[int, list[str]]], times: Sequence[float]
) -> None:
    for k in range(1, len(times)):
        if times[k] <= times[k - 1]:
            raise RecordingError(
                table.path,
                f"{times[k]:.12g} s does not come after {times[k - 1]:.12g} s of the row before; "
                "times must increase: sort the rows, or write more digits",
                line=rows[k][0],
                column="t",
            )
    if times[0] < EPOCH:
        return
    place = table.index("t")
    digits = max(_decimals(row[place]) for _, row in rows)
    step = (times[-1] - times[0]) / (len(times) - 1)
    unit = (times[0] / (number(rows[0][1][place], "," in rows[0][1][place]) or 1.0)) or 1.0
    if 10.0**-digits * unit > _COARSE * step * (1.0 + 1e-6):
        raise RecordingError(
            table.path,
            f"{rows[0][1][place].strip()} counts from 1970 with {digits} decimals, too few digits "
            f"for steps of {step:.3g} s; write t from the beginning of the drive, or with all six "
            "decimals",
            line=rows[0][0],
            column="t",
        )


def _decimals(text: str) -> int:
    mantissa, _, exponent = text.strip().lower().replace(",", ".").partition("e")
    fraction = mantissa.partition(".")[2]
    return len(fraction) - (int(exponent) if exponent else 0)


def _kinematic(row: Sequence[float]) -> Vector3:
    roll, pitch = row[8], row[9]
    return (
        row[1] + GRAVITY * sin(pitch),
        row[2] - GRAVITY * sin(roll) * cos(pitch),
        row[3] - GRAVITY * cos(roll) * cos(pitch),
    )


def _sample(
    row: Sequence[float], is_force: bool, extras: Extras, line: int, fields: Sequence[str]
) -> RecordedSample:
    t, ax, ay, az, p, q, r, v, roll, pitch = row
    acceleration = _kinematic(row) if is_force else (ax, ay, az)
    if not extras.any:
        return RecordedSample(t, acceleration, (p, q, r), v, (roll, pitch))
    return RecordedSample(
        t,
        acceleration,
        (p, q, r),
        v,
        (roll, pitch),
        extras.mode(line, fields),
        extras.driver(line, fields),
        extras.preview(line, fields),
        extras.value("sender_time_s", line, fields),
        extras.value("sim_time_s", line, fields),
    )
