"""Recorded drives: CSV files of what a vehicle did, read with exact complaints."""

from __future__ import annotations

import csv
from bisect import bisect_right
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Final

COLUMNS: Final = ("t", "ax", "ay", "az", "p", "q", "r", "v", "roll", "pitch")
"""Columns a recording must have, in any order; further ones are ignored."""

_RECORDINGS: Final = Path(__file__).parent / "recordings"


class RecordingError(Exception):
    """A recording cannot be found or read.

    Attributes:
        path: The file.
        line: Line in the file, from 1; None if it is the file as a whole.
        column: Name of the column; None if it is the line as a whole.
    """

    def __init__(
        self, path: Path, complaint: str, *, line: int | None = None, column: str | None = None
    ) -> None:
        where = f"{path}"
        where += "" if line is None else f", line {line}"
        where += "" if column is None else f", column {column}"
        super().__init__(f"{where}: {complaint}")
        self.path = path
        self.line = line
        self.column = column


@dataclass(frozen=True, slots=True)
class RecordedSample:
    """One instant of a recording, ISO 8855 body axes.

    Attributes:
        time: Since whatever the recording counts from [s].
        acceleration: Kinematic acceleration x, y, z, gravity removed [m/s^2].
        rates: Body rates p, q, r [rad/s].
        speed: Forward speed [m/s].
        attitude: Roll (positive left side up), pitch (positive nose down) [rad].
    """

    time: float
    acceleration: tuple[float, float, float]
    rates: tuple[float, float, float]
    speed: float
    attitude: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Recording:
    """A whole drive.

    Attributes:
        path: The file it came from.
        samples: At least two, their times strictly increasing.
    """

    path: Path
    samples: tuple[RecordedSample, ...]

    @property
    def duration(self) -> float:
        """From the first to the last sample [s]."""
        return self.samples[-1].time - self.samples[0].time

    @property
    def period(self) -> float:
        """Mean spacing of the samples [s]."""
        return self.duration / (len(self.samples) - 1)

    def index_at(self, time: float) -> int:
        """Index of the last sample not later than `time` [s], of the first if none is."""
        return max(0, bisect_right(self.samples, time, key=_time_of) - 1)


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
    """Read a CSV file with the columns `COLUMNS`.

    Raises:
        RecordingError: The file cannot be read; file, line and column are named.
    """
    file = Path(path)
    samples: list[RecordedSample] = []
    try:
        with file.open(encoding="utf-8-sig", newline="") as stream:
            reader = csv.reader(stream)
            header = [name.strip() for name in next(reader, [])]
            order = _column_order(file, header)
            for row in reader:
                if row:
                    samples.append(_read_row(file, reader.line_num, header, order, row))
                    _check_time(file, reader.line_num, samples)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise RecordingError(file, f"cannot be read as CSV text ({error})") from error
    if len(samples) < 2:
        raise RecordingError(file, f"has {len(samples)} samples; a recording needs at least two")
    return Recording(file, tuple(samples))


def _column_order(path: Path, header: list[str]) -> list[int]:
    for column in COLUMNS:
        if header.count(column) != 1:
            raise RecordingError(
                path,
                f"the header has this column {header.count(column)} times, needed is once; "
                f"the first line names the columns {','.join(COLUMNS)}",
                line=1,
                column=column,
            )
    return [header.index(column) for column in COLUMNS]


def _read_row(
    path: Path, line: int, header: list[str], order: list[int], row: list[str]
) -> RecordedSample:
    if len(row) != len(header):
        raise RecordingError(
            path, f"{len(row)} fields, the header names {len(header)}", line=line
        )  # fmt: skip
    values: list[float] = []
    for column, index in zip(COLUMNS, order, strict=True):
        try:
            value = float(row[index])
        except ValueError:
            value = float("nan")
        if not isfinite(value):
            raise RecordingError(
                path, f"{row[index]!r} is not a finite number", line=line, column=column
            )
        values.append(value)
    t, ax, ay, az, p, q, r, v, roll, pitch = values
    return RecordedSample(t, (ax, ay, az), (p, q, r), v, (roll, pitch))


def _check_time(path: Path, line: int, samples: list[RecordedSample]) -> None:
    if len(samples) > 1 and samples[-1].time <= samples[-2].time:
        raise RecordingError(
            path,
            f"{samples[-1].time} s does not come after {samples[-2].time} s of the row before; "
            f"times must increase",
            line=line,
            column="t",
        )


def _time_of(sample: RecordedSample) -> float:
    return sample.time
