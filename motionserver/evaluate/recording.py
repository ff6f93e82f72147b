"""Recorded drives as arrays: a CSV file read with exact complaints."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from motionserver.core.axes import Array, frozen
from motionserver.core.kinematics.rotation import gravity_in_body
from motionserver.errors import MotionServerError

COLUMNS: Final = ("t", "ax", "ay", "az", "p", "q", "r", "v", "roll", "pitch")
"""Columns a recording must have, in any order; further ones are ignored."""


class RecordingError(MotionServerError):
    """A recording cannot be read; tells file, line (from 1) and column.

    Attributes:
        line: Line in the file; None if it is the file as a whole.
        column: Name of the column; None if it is the line as a whole.
    """

    def __init__(
        self, path: Path, complaint: str, line: int | None = None, column: str | None = None
    ) -> None:
        where = str(path)
        where += "" if line is None else f", line {line}"
        where += "" if column is None else f", column {column}"
        super().__init__(f"{where}: {complaint}")
        self.line = line
        self.column = column


@dataclass(frozen=True, slots=True)
class Recording:
    """A whole drive, its clock beginning at zero.

    Attributes:
        name: File name without its ending.
        times: Instants, increasing from 0, (N,) [s].
        force: Specific force at the sent point, gravity included, (N, 3) [m/s2].
        rates: Body rates, (N, 3) [rad/s].
        speed: Forward speed, (N,) [m/s].
    """

    name: str
    times: Array
    force: Array
    rates: Array
    speed: Array

    @property
    def duration(self) -> float:
        """Instant of the last sample [s]."""
        return float(self.times[-1])

    def excerpt(self, start: float, end: float) -> Recording:
        """The samples from ``start`` to ``end`` [s], the clock set to zero again.

        Raises:
            ValueError: Fewer than two samples are left.
        """
        kept = (self.times >= start - 1e-9) & (self.times <= end + 1e-9)
        if int(kept.sum()) < 2:
            raise ValueError(
                f"recording {self.name}: fewer than two samples between {start:g} s and {end:g} s; "
                f"it lasts from 0 s to {self.duration:g} s"
            )
        return from_samples(
            self.name, self.times[kept], self.force[kept], self.rates[kept], self.speed[kept]
        )


def from_samples(name: str, times: Array, force: Array, rates: Array, speed: Array) -> Recording:
    """A recording of arrays as described there; the clock is set to zero."""
    return Recording(name, frozen(times - times[0]), frozen(force), frozen(rates), frozen(speed))


def read_recording(path: str | Path) -> Recording:
    """Read a CSV file with the columns `COLUMNS`.

    ``ax, ay, az`` are kinematic accelerations in body axes, gravity removed [m/s2]; specific force
    is f = a + g (-sin pitch, sin roll cos pitch, cos roll cos pitch). ``p, q, r`` [rad/s], ``v``
    [m/s], ``roll, pitch`` [rad].

    Args:
        path: The file.

    Returns:
        The drive.

    Raises:
        RecordingError: The file cannot be read; file, line and column are named.
    """
    file = Path(path)
    try:
        with file.open(encoding="utf-8-sig", newline="") as stream:
            reader = csv.reader(stream)
            header = [name.strip() for name in next(reader, [])]
            rows = [(reader.line_num, row) for row in reader if row]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise RecordingError(file, f"cannot be read as CSV text ({error})") from error
    order = _column_order(file, header)
    if len(rows) < 2:
        raise RecordingError(file, f"has {len(rows)} samples; a recording needs at least two")
    table = _table(file, header, order, rows)
    t, ax, ay, az, p, q, r, v, roll, pitch = table.T
    behind = np.flatnonzero(np.diff(t) <= 0.0)
    if len(behind):
        row = int(behind[0]) + 1
        raise RecordingError(
            file,
            f"{t[row]:g} s does not come after {t[row - 1]:g} s of the row before; "
            "times must increase",
            rows[row][0],
            "t",
        )
    force = np.column_stack((ax, ay, az)) + gravity_in_body(roll, pitch)
    return from_samples(file.stem, t, force, np.column_stack((p, q, r)), v)


def _column_order(path: Path, header: list[str]) -> list[int]:
    for column in COLUMNS:
        if header.count(column) != 1:
            raise RecordingError(
                path,
                f"the header has this column {header.count(column)} times, needed is once; "
                f"the first line names the columns {','.join(COLUMNS)}",
                1,
                column,
            )
    return [header.index(column) for column in COLUMNS]


def _table(
    path: Path, header: list[str], order: list[int], rows: list[tuple[int, list[str]]]
) -> Array:
    for line, row in rows:
        if len(row) != len(header):
            raise RecordingError(path, f"{len(row)} fields, the header names {len(header)}", line)
    try:
        table: Array = np.array([[float(row[i]) for i in order] for _, row in rows])
        if np.isfinite(table).all():
            return table
    except ValueError:
        pass
    line, column, text = _first_bad(order, rows)
    raise RecordingError(path, f"{text!r} is not a finite number", line, column)


def _first_bad(order: list[int], rows: list[tuple[int, list[str]]]) -> tuple[int, str, str]:
    for line, row in rows:
        for column, index in zip(COLUMNS, order, strict=True):
            try:
                good = bool(np.isfinite(float(row[index])))
            except ValueError:
                good = False
            if not good:
                return line, column, row[index]
    raise AssertionError("called only when a field is bad")
