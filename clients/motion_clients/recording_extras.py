"""What the server's own recordings tell beside a drive: mode, pedals, preview, states, settings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from motion_protocol import DriverInputs, Mode

from .csv_table import Table, number
from .csv_text import RecordingError
from .drive_samples import PreviewSample

DRIVER: Final = ("throttle", "brake", "clutch", "steering", "gear")
EXTRAS: Final = ("mode", *DRIVER, "sender_time_s", "sim_time_s", "preview")
"""What the server's own recordings add to a sample; each may be missing, and empty in any row."""
OWN: Final = ("time_s", "state")
"""Columns that mark the server's own recordings."""
_MODES: Final = {mode.name.lower(): mode for mode in Mode}


class Extras:
    """Readers of `EXTRAS`; what is missing or empty was not told."""

    def __init__(self, table: Table) -> None:
        self._path = table.path
        is_own = table.has(*OWN)
        self._places: dict[str, int] = {
            name: table.index(name) for name in EXTRAS if is_own and name in table.names
        }
        self.any = bool(self._places)

    def _field(self, name: str, fields: Sequence[str]) -> str:
        place = self._places.get(name)
        return "" if place is None else fields[place].strip()

    def value(self, name: str, line: int, fields: Sequence[str]) -> float | None:
        """A number; None if it is not told."""
        text = self._field(name, fields)
        return self._number(text, name, line) if text else None

    def mode(self, line: int, fields: Sequence[str]) -> Mode:
        """What the simulator was doing."""
        text = self._field("mode", fields)
        if text and text not in _MODES:
            raise RecordingError(
                self._path,
                f"{text!r} is no mode; known are {', '.join(_MODES)}",
                line=line,
                column="mode",
            )
        return _MODES[text] if text else Mode.DRIVE

    def driver(self, line: int, fields: Sequence[str]) -> DriverInputs | None:
        """What the driver did; None if it is not told."""
        if not self._field(DRIVER[0], fields):
            return None
        told = [self._number(self._field(name, fields), name, line) for name in DRIVER]
        return DriverInputs(told[0], told[1], told[2], told[3], round(told[4]))

    def preview(self, line: int, fields: Sequence[str]) -> tuple[PreviewSample, ...]:
        """What was expected to come."""
        text = self._field("preview", fields)
        out = []
        for part in text.split("/") if text else ():
            told = [self._number(word, "preview", line) for word in part.split()]
            if len(told) != 7:
                raise RecordingError(
                    self._path,
                    f"{part.strip()[:60]!r} is not: time, 3 accelerations, 3 rates",
                    line=line,
                    column="preview",
                )
            t, ax, ay, az, p, q, r = told
            out.append(PreviewSample(t, (ax, ay, az), (p, q, r)))
        return tuple(out)

    def _number(self, text: str, name: str, line: int) -> float:
        value = number(text)
        if value is None:
            raise RecordingError(
                self._path, f"{text!r} is not a finite number", line=line, column=name
            )
        return value


def changes(
    table: Table, rows: Sequence[tuple[int, list[str]]], column: str
) -> tuple[tuple[float, str], ...]:
    """When a word of the server's own recordings changed, and to what; empty fields say nothing."""
    if column not in table.names:
        return ()
    word, time = table.index(column), table.index("time_s")
    out: list[tuple[float, str]] = []
    for line, row in rows:
        text = row[word].strip()
        if not text or (out and out[-1][1] == text):
            continue
        at = number(row[time])
        if at is None:
            raise RecordingError(
                table.path, f"{row[time]!r} is not a finite number", line=line, column="time_s"
            )
        out.append((at, text))
    return tuple(out)
