"""A table of numbers from CSV text in any usual dialect, with complaints that name the place.

Fields are parted by comma, semicolon, tab, bar or blanks; decimals by point or comma. Lines that
begin with ``#``, ``%`` or ``//``, empty lines and Excel's ``sep=;`` are passed over. Names are
taken in small letters; a unit stands behind a name (``t [s]``, ``ax (g)``, ``v / km/h``) or in a
line of its own below the names.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Final

from .csv_header import BLANK, bare, names_of, recognised, separator_of, split
from .csv_text import RecordingError, read_text
from .units import factor, known_units

_COMMENTS: Final = ("#", "%", "//")
_SEP_LINE: Final = re.compile(r'"?sep=(.)"?', re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of text under named columns.

    Attributes:
        path: The file.
        header_line: Line of the names, from 1.
        names: Names in small letters, units taken off.
        units: Unit of each column as written; empty if none is.
        rows: Line, from 1, and fields of every row.
        separator: What parts fields; a blank for any white space.
        is_cut: True if the last line lacks its end, as after a power cut.
    """

    path: Path
    header_line: int
    names: tuple[str, ...]
    units: tuple[str, ...]
    rows: tuple[tuple[int, list[str]], ...]
    separator: str
    is_cut: bool

    def has(self, *columns: str) -> bool:
        """Whether each of these columns is there."""
        return all(column in self.names for column in columns)

    def index(self, column: str) -> int:
        """Where a column stands.

        Raises:
            RecordingError: It is not there, or more than once.
        """
        count = self.names.count(column)
        if count != 1:
            raise RecordingError(
                self.path,
                f"the header has this column {count} times, needed is once; names found: "
                f"{', '.join(filter(None, self.names))[:200] or 'none'}",
                line=self.header_line,
                column=column,
            )
        return self.names.index(column)

    def numbers(
        self, columns: Sequence[str], rows: Sequence[tuple[int, list[str]]] | None = None
    ) -> list[list[float]]:
        """Values in SI, one list per row; of these rows only, if any are given.

        Raises:
            RecordingError: A column is missing, a unit unknown, a field no finite number.
        """
        rows = self.rows if rows is None else rows
        places = [self.index(column) for column in columns]
        factors = [
            self._factor(column, place) for column, place in zip(columns, places, strict=True)
        ]
        commas = any("," in row[place] for _, row in rows for place in places)
        out = []
        for line, row in rows:
            values = []
            for column, place, scale in zip(columns, places, factors, strict=True):
                value = number(row[place], commas)
                if value is None:
                    raise RecordingError(
                        self.path, _no_number(row[place], commas), line=line, column=column
                    )
                values.append(value if scale == 1.0 else value * scale)
            out.append(values)
        return out

    def unit(self, column: str) -> str:
        """Unit of a column as written; empty if none is."""
        return self.units[self.index(column)]

    def _factor(self, column: str, place: int) -> float:
        unit = self.units[place]
        scale = 1.0 if not unit else factor(column, unit)
        if scale is None:
            raise RecordingError(
                self.path,
                f"unit {unit!r} is not known; known are {known_units(column)}",
                line=self.header_line,
                column=column,
            )
        return scale


def number(text: str, decimal_commas: bool = False) -> float | None:
    """The finite number that a field says; None if it says none."""
    plain = text.strip().replace("\N{MINUS SIGN}", "-")
    if decimal_commas:
        if "." in plain and "," in plain:
            return None
        if "." in plain and not plain.endswith("."):
            return None
        plain = plain.replace(",", ".")
    if "_" in plain:
        return None
    try:
        value = float(plain)
    except ValueError:
        return None
    return value if isfinite(value) else None


def read_table(path: Path, known: Sequence[str]) -> Table:
    """Read a file.

    Args:
        path: The file.
        known: Columns that are looked for; they tell what is the header, and what parts fields.

    Raises:
        RecordingError: The file cannot be read, or a row has another number of fields.
    """
    text = read_text(path)
    lines = [
        (number, line.rstrip("\n"))
        for number, line in enumerate(text.split("\n"), start=1)
        if line.strip()
    ]
    separator = ""
    if lines and (told := _SEP_LINE.fullmatch(lines[0][1].strip(" "))):
        separator = told.group(1)
        lines = lines[1:]
    plain = [(number, line) for number, line in lines if not _is_comment(line)]
    header_line, header = plain[0] if plain else (1, "")
    plain = plain[1:]
    if header and not recognised(header, known):
        remarked = [(n, line) for n, line in lines if _is_comment(line) and n < header_line]
        if remarked and recognised(remarked[-1][1].lstrip("#%/ "), known) >= 3:
            # written by numpy.savetxt and the like: the names stand in a comment
            plain.insert(0, (header_line, header))
            header_line, header = remarked[-1][0], remarked[-1][1].lstrip("#%/ ")
    separator = separator or separator_of(header, known)
    names, units = names_of(split(header, separator))
    try:
        rows = [(line, row) for line, row in _rows(plain, separator) if any(f.strip() for f in row)]
    except csv.Error as error:
        raise RecordingError(path, f"cannot be read as CSV text ({error})") from error
    if rows and not any(units) and _is_units(rows[0][1], names, known):
        units = tuple(bare(unit) for unit in rows[0][1]) + ("",) * len(names)
        units = units[: len(names)]
        rows = rows[1:]
    is_cut = not text.endswith("\n")
    return Table(path, header_line, names, units, tuple(rows), separator, is_cut)


def check_lengths(table: Table, rows: Sequence[tuple[int, list[str]]]) -> None:
    """Make sure that every row has a field for each name; empty ones at its end may be more.

    Raises:
        RecordingError: One has not.
    """
    count = len(table.names)
    for line, row in rows:
        if len(row) == count or (len(row) > count and not any(f.strip() for f in row[count:])):
            continue
        hint = ""
        if table.separator == "," and len(row) > count:
            hint = "; with decimal commas, part the fields by semicolons"
        raise RecordingError(
            table.path, f"{len(row)} fields, the header names {count}{hint}", line=line
        )


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith(_COMMENTS)


def _is_units(row: Sequence[str], names: Sequence[str], known: Sequence[str]) -> bool:
    """Whether a row tells the unit of some known column and a number for none."""
    told = [
        (name, field) for name, field in zip(names, row, strict=False) if name in known and field
    ]
    units = [name for name, field in told if factor(name, bare(field)) is not None]
    plain = [name for name, field in told if number(field, "," in field) is not None]
    return bool(units) and not plain and len(units) == len([f for _, f in told if bare(f)])


def _rows(lines: Sequence[tuple[int, str]], separator: str) -> Iterator[tuple[int, list[str]]]:
    if separator == BLANK:
        for line, text in lines:
            yield line, text.split()
        return
    reader = csv.reader((text + "\n" for _, text in lines), delimiter=separator)
    for row in reader:
        yield lines[reader.line_num - 1][0], row


def _no_number(text: str, decimal_commas: bool) -> str:
    if decimal_commas and "." in text:
        return f"{text!r} has a decimal point, other fields have decimal commas: write one of them"
    return f"{text!r} is not a finite number"
