"""The line of names of a CSV file: what parts the fields, which columns there are, in what unit."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from typing import Final

_SEPARATORS: Final = (";", "\t", ",", "|")
_WITH_UNIT: Final = re.compile(r"(.*?)\s*(?:[\[({<](.*)[\])}>]|\s/\s*(.+)|\s+in\s+(.+))\s*")
_BLANKS: Final = re.compile(r"\s+(?![\[(])")
_ALIASES: Final = {"t": ("time",), "v": ("speed", "velocity")}
BLANK: Final = " "
"""Parts fields by any white space."""


def separator_of(header: str, known: Sequence[str]) -> str:
    """What parts most known names; a comma if nothing does."""
    there = [one for one in _SEPARATORS if one in header]
    best = max(there, key=lambda one: _count(header, one, known), default=None)
    if best is not None and (_count(header, best, known) > 1 or len(header.split()) < 3):
        return best
    if _count(header, BLANK, known) > 1:
        return BLANK
    return best or ","


def recognised(header: str, known: Sequence[str]) -> int:
    """How many known names a line holds, whatever parts them."""
    return max(_count(header, one, known) for one in (*_SEPARATORS, BLANK))


def _count(header: str, separator: str, known: Sequence[str]) -> int:
    return len(set(names_of(split(header, separator))[0]) & set(known))


def split(line: str, separator: str) -> list[str]:
    """Fields of one line."""
    if separator == BLANK:
        return _BLANKS.split(line.strip())
    try:
        return next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
    except csv.Error:
        return []


def names_of(fields: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names in small letters, and the units behind them."""
    names, units = [], []
    for field in fields:
        plain = field.strip().strip('"').strip()
        found = _WITH_UNIT.fullmatch(plain)
        name = plain if found is None else found.group(1)
        unit = "" if found is None else next((g for g in found.groups()[1:] if g), "")
        names.append(name.strip().lower())
        units.append(bare(unit))
    for wanted, others in _ALIASES.items():
        for other in others:
            if wanted not in names and names.count(other) == 1:
                names[names.index(other)] = wanted
    return tuple(names), tuple(units)


def bare(unit: str) -> str:
    """A unit without brackets; empty for one that says nothing."""
    bare = unit.strip().strip("[](){}<>").strip()
    return "" if bare in ("-", "1", "") else bare
