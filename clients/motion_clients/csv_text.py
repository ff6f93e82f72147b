"""The text of a CSV file, whoever wrote it: a regular file of bounded size in a known encoding."""

from __future__ import annotations

import codecs
import io
import os
import stat
from pathlib import Path
from typing import Final

MOST_BYTES: Final = 1 << 30
"""A larger file is refused before it is read."""
_NO_WAIT: Final = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)


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

    def __reduce__(self) -> tuple[object, ...]:
        """Travel between processes whole."""
        return _rebuilt, (self.path, str(self), self.line, self.column)


def _rebuilt(path: Path, text: str, line: int | None, column: str | None) -> RecordingError:
    error = RecordingError(path, "", line=line, column=column)
    error.args = (text,)
    return error


def read_text(path: Path, most_bytes: int = MOST_BYTES) -> str:
    """Read a file as text with plain line ends.

    UTF-8 with or without a byte order mark, UTF-16 with one (Excel's "Unicode text"), else the
    Windows code page of Western Europe, in which a superscript 2 is no UTF-8.

    Raises:
        RecordingError: It is no regular file, too large, or no text.
    """
    data = _bytes_of(path, most_bytes)
    try:
        text = _decoded(data)
    except UnicodeError as error:
        raise RecordingError(path, f"cannot be read as CSV text ({error})") from error
    if "\0" in text:
        raise RecordingError(
            path,
            "cannot be read as CSV text (it holds zero bytes: is it a spreadsheet? Export CSV)",
        )
    return io.StringIO(text, newline=None).read()


def _bytes_of(path: Path, most_bytes: int) -> bytes:
    try:
        # not to wait for whoever may write into a pipe
        descriptor = os.open(path, os.O_RDONLY | _NO_WAIT)
    except (OSError, ValueError) as error:
        raise RecordingError(path, f"cannot be read as CSV text ({error})") from error
    try:
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode):
            raise RecordingError(path, "is no regular file: cannot be read as CSV text")
        if status.st_size > most_bytes:
            raise RecordingError(
                path,
                f"has {status.st_size / 1e6:.0f} MB, read are at most {most_bytes / 1e6:.0f} MB: "
                "cut the drive in parts",
            )
        with os.fdopen(descriptor, "rb", closefd=False) as file:
            return file.read(most_bytes + 1)
    except OSError as error:
        raise RecordingError(path, f"cannot be read as CSV text ({error})") from error
    finally:
        os.close(descriptor)


def _decoded(data: bytes) -> str:
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        text = data.decode("utf-16")
        if "\n" not in text and "\r" not in text:
            raise UnicodeError("UTF-16 without a single line")
        return text
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("cp1252")
