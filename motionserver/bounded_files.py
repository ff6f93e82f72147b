"""Reading files that somebody names: regular ones only, and never more than a stated size.

A device such as /dev/zero has no end, a named pipe keeps its reader waiting, and a file of some
gigabytes fills the memory. Every file that a person, a key or an option names is read here.
"""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import Final

KIB: Final = 1 << 10
MIB: Final = 1 << 20
SETTINGS_BYTES: Final = MIB
"""Largest file of settings: configuration, machine, tuning, boundaries, certificates."""
_CHUNK: Final = MIB
_KINDS: Final = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a named pipe"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
    (stat.S_ISSOCK, "a socket"),
)


class FileNotUsableError(OSError):
    """A file that exists and is not read; `strerror` says why, as for every OSError."""


def check_regular(path: str | Path, most: int) -> None:
    """Make sure that a file is one that `read_bounded` reads, without opening it.

    Args:
        path: The file.
        most: Largest size [bytes].

    Raises:
        OSError: It does not exist, is no regular file, or is larger.
    """
    _check(os.stat(path), path, most)


def read_bounded(path: str | Path, most: int) -> bytes:
    """Read a whole regular file.

    Args:
        path: The file.
        most: Largest size [bytes].

    Raises:
        OSError: It cannot be read, is no regular file, or is larger.
    """
    return read_with_status(path, most)[0]


def read_bounded_text(path: str | Path, most: int) -> str:
    """Read a whole regular file as UTF-8; a byte order mark is left out.

    Raises:
        OSError: As `read_bounded`.
        UnicodeDecodeError: It is no UTF-8.
    """
    return read_bounded(path, most).decode("utf-8-sig")


def read_with_status(path: str | Path, most: int) -> tuple[bytes, os.stat_result]:
    """Read a whole regular file, and tell whose it is and who may read it.

    Args:
        path: The file.
        most: Largest size [bytes].

    Returns:
        Its bytes, and the status of the very file that was read.

    Raises:
        OSError: It cannot be read, is no regular file, or is larger.
    """
    check_regular(path, most)  # opening some devices already does something
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
    try:
        about = os.fstat(descriptor)
        _check(about, path, most)
        chunks, size = [], 0
        while chunk := os.read(descriptor, min(_CHUNK, most + 1 - size)):
            chunks.append(chunk)
            size += len(chunk)
            if size > most:  # it grows, or does not state its size, as in /proc
                raise _too_large(path, most)
    finally:
        os.close(descriptor)
    return b"".join(chunks), about


def _check(about: os.stat_result, path: str | Path, most: int) -> None:
    if not stat.S_ISREG(about.st_mode):
        kind = next((name for test, name in _KINDS if test(about.st_mode)), "something else")
        number = errno.EISDIR if stat.S_ISDIR(about.st_mode) else errno.EINVAL
        raise FileNotUsableError(number, f"is {kind}, not a regular file", str(path))
    if about.st_size > most:
        raise _too_large(path, most)


def _too_large(path: str | Path, most: int) -> FileNotUsableError:
    size = f"{most // MIB} MiB" if most >= MIB else f"{most} bytes"
    return FileNotUsableError(errno.EFBIG, f"is larger than {size}, the most allowed", str(path))
