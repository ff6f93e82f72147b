"""The chain of the audit log: read over rotated files, walked, and its first break named.

Every line carries the SHA-256 of the line before under ``previous``. That shows every line that was
changed, removed, inserted or moved, but for two things no chain can show by itself: its last lines
cut off, and a chain rewritten as a whole. Against the first the newest hash is kept beside the log
(`Head`); against the second, and against somebody who cuts both, only a hash noted elsewhere helps.

What a power cut leaves, bytes that are no line, stays in the file: the writer goes on behind it
with a line ``resume`` whose ``broken`` is the hash of those bytes, and whose ``previous`` is that
of the last whole line.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from motionserver.bounded_files import MIB, SETTINGS_BYTES, read_bounded

LARGEST_LOG: Final = 256 * MIB
"""Largest file of a log that is read; one is put aside long before."""
RESUME: Final = "resume"
"""Action of the line that a writer begins with where the end is not what it had left."""


@dataclass(frozen=True, slots=True)
class Line:
    """One line of one file.

    Attributes:
        file: Name of the file.
        number: From 1, within the file.
        text: Its bytes, without the end of line.
        entry: What it says; None if it is no entry.
        is_ended: False for a last line without its end of line.
    """

    file: str
    number: int
    text: bytes
    entry: dict[str, Any] | None
    is_ended: bool = True

    @property
    def digest(self) -> str:
        """Its hash."""
        return digest(self.text)

    @property
    def previous(self) -> str:
        """The hash of the line it was written after."""
        return "" if self.entry is None else str(self.entry["previous"])

    def __str__(self) -> str:
        return f"{self.file} line {self.number}"


@dataclass(frozen=True, slots=True)
class Head:
    """What is kept beside the log.

    Attributes:
        head: Hash of the newest line.
        begins: What the oldest kept line may carry as ``previous``; two while files are rotated.
    """

    head: str
    begins: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Walk:
    """What walking the chain found.

    Attributes:
        lines: All lines, oldest first.
        problem: The first break in words, "" if the chain is whole.
        notes: What is worth knowing and breaks nothing.
    """

    lines: tuple[Line, ...]
    problem: str
    notes: tuple[str, ...]

    @property
    def head(self) -> str:
        """Hash of the newest whole line; "" without one."""
        return next((line.digest for line in reversed(self.lines) if line.entry is not None), "")


def digest(text: bytes) -> str:
    """The hash of one line."""
    return hashlib.sha256(text).hexdigest()


def rotated(path: Path) -> Path:
    """Where a full log is put aside."""
    return path.with_name(path.name + ".1")


def head_path(path: Path) -> Path:
    """Where the newest hash is kept."""
    return path.with_name(path.name + ".head")


def read_head(path: Path) -> Head | None:
    """What is kept beside the log ``path``; None if there is nothing that can be read."""
    try:
        data = json.loads(read_bounded(head_path(path), SETTINGS_BYTES))
        return Head(str(data["head"]), tuple(map(str, data["begins"])))
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def read_lines(path: Path) -> list[Line]:
    """All lines of one file.

    Raises:
        OSError: It cannot be read.
    """
    *whole, last = read_bounded(path, LARGEST_LOG).split(b"\n")
    lines = [Line(path.name, i, text, _entry(text)) for i, text in enumerate(whole, start=1)]
    if last:
        lines.append(Line(path.name, len(lines) + 1, last, _entry(last), is_ended=False))
    return lines


def _entry(text: bytes) -> dict[str, Any] | None:
    try:
        entry = json.loads(text)
    except (ValueError, RecursionError):
        return None
    good = isinstance(entry, dict) and isinstance(entry.get("previous"), str)
    return entry if good else None


def broken_end(lines: Sequence[Line]) -> bytes:
    """What stands behind the last whole line: nothing, or what a power cut left."""
    texts: list[bytes] = []
    for line in reversed(lines):
        if line.entry is not None:
            break
        texts.append(line.text)
    return b"\n".join(reversed(texts))


def walk(lines: Sequence[Line], head: Head | None, has_older: bool) -> Walk:
    """Follow the chain.

    Args:
        lines: All lines, oldest file first.
        head: What is kept beside the log, if anything.
        has_older: True if a rotated file is among them, so that older ones may be gone.
    """
    entries = [i for i, line in enumerate(lines) if line.entry is not None]
    where = {lines[i].digest: k for k, i in enumerate(entries)}
    notes: list[str] = []
    after = -1
    for k, i in enumerate(entries):
        line = lines[i]
        between = lines[after + 1 : i]
        if between:
            if line.entry is None or line.entry.get("broken") != digest(_joined(between)):
                what = f"{between[0]}: was changed or inserted; it is no entry"
                return Walk(tuple(lines), what, tuple(notes))
            notes.append(f"{between[0]}: broken by a power cut; {line} goes on behind it")
        if k == 0:
            problem = _at_the_beginning(line, head, has_older, notes)
        else:
            problem = _step([lines[j] for j in entries], k, where)
        problem = problem or _resumed(line, k, where, notes)
        if problem:
            return Walk(tuple(lines), problem, tuple(notes))
        after = i
    problem = _at_the_end(lines[after + 1 :], notes)
    return Walk(tuple(lines), problem or _against(head, entries, where), tuple(notes))


def _joined(lines: Sequence[Line]) -> bytes:
    return b"\n".join(line.text for line in lines)


def _at_the_beginning(line: Line, head: Head | None, has_older: bool, notes: list[str]) -> str:
    if head is not None and line.previous not in head.begins:
        return f"{line}: lines before it were removed, or it was changed or inserted"
    if line.previous and not has_older:
        return f"{line}: the lines or the file before it were removed"
    if line.previous:
        notes.append(f"{line} follows lines that were rotated away: what was there is not checked")
    return ""


def _step(entries: Sequence[Line], k: int, where: dict[str, int]) -> str:
    """Why entry k does not follow the one before; "" if it does."""
    line, before = entries[k], entries[k - 1]
    if line.previous == before.digest:
        return ""
    at = where.get(line.previous)
    if at is not None and at < k:
        first = entries[at + 1]
        return f"{first}: was inserted, with everything up to {before}"
    if at is not None:
        return f"{line}: was moved; the line it was written after stands at {entries[at]}"
    if line.previous == entries[0].previous:
        return f"{entries[0]}: was inserted, with everything up to {before}"
    if k + 1 < len(entries) and entries[k + 1].previous != line.digest:
        return f"{line}: was changed or inserted"
    return f"{before}: was changed, or lines between it and {line} were removed"


def _resumed(line: Line, k: int, where: dict[str, int], notes: list[str]) -> str:
    """What a line that resumes says of the end its writer had found."""
    assert line.entry is not None
    stored = line.entry.get("stored_head")
    if line.entry.get("action") != RESUME or stored is None:
        return ""
    found = where.get(str(stored))
    if found is None or found >= k:
        return f"{line}: resumed behind an end that is not the stored one: lines before it were cut"
    notes.append(f"{line}: resumed; the {k - 1 - found} lines before it were not sealed yet")
    return ""


def _at_the_end(rest: Sequence[Line], notes: list[str]) -> str:
    if not rest:
        return ""
    if rest[-1].is_ended:
        return f"{rest[0]}: was changed or inserted; it is no entry"
    notes.append(
        f"{rest[0]}: broken last line, as a power cut leaves it; repairable: the server goes on "
        "behind it with its next entry"
    )
    return ""


def _against(head: Head | None, entries: Sequence[int], where: dict[str, int]) -> str:
    """Compare the end with what is kept beside the log."""
    if head is None:
        return ""
    at = where.get(head.head)
    if at is None:
        return "the end: the stored head is not in the log: last lines were cut off or changed"
    beyond = len(entries) - 1 - at
    if beyond:
        return f"the end: {beyond} lines stand behind the stored head: added, or the power went"
    return ""
