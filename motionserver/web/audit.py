"""Who changed what: one JSON line each, every line carrying the hash of the one before."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import json
import time
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from motionserver.web.audit_chain import (
    RESUME,
    Line,
    broken_end,
    digest,
    head_path,
    read_head,
    read_lines,
    rotated,
)
from motionserver.web.auth import Caller

_LARGEST: Final = 4 * 1024 * 1024
"""Size at which the file is put aside as `.1` [B]."""

_TRIES: Final = 10
_PAUSE: Final = 1e-3
"""How long another server is waited for, with all requests [s]."""


class Audit:
    """Appends to a file; a disk that refuses costs the line, never the request.

    The newest hash is kept in a file beside it, so that `motionserver audit verify` sees an end
    that was cut off. After a power cut it goes on behind what the cut left. Several servers of one
    state directory may write to one log: each finds out under a lock what the others have written.

    Args:
        path: The file.
        largest: Size at which it is put aside [B].
    """

    def __init__(self, path: Path, largest: int = _LARGEST) -> None:
        self._path, self._largest = path, largest
        self.lost = 0
        self.unsealed = 0
        self._load()

    def _load(self) -> None:
        path = self._path
        self._left = _about(path)
        lines, older = _lines(path), _lines(rotated(path))
        whole = [line for line in (*older, *lines) if line.entry is not None]
        self._previous = whole[-1].digest if whole else ""
        self._begins: tuple[str, ...] = (whole[0].previous if whole else "",)
        self._resume = self._found(path, lines)
        # an end of line that is missing is given first, or the next line would stand on that one
        self._glue = "\n" if lines and not lines[-1].is_ended else ""

    def _found(self, path: Path, lines: list[Line]) -> dict[str, str]:
        """What is not as it was left, for the line that resumes."""
        found = {}
        broken, head = broken_end(lines), read_head(path)
        if broken:
            found["broken"] = digest(broken)
        if head is not None:
            if self._begins[0] not in head.begins:
                # what is missing at the beginning shall stay visible
                self._begins = head.begins
            if head.head != self._previous:
                found["stored_head"] = head.head
        return found

    def note(self, action: str, caller: Caller, result: str, **more: Any) -> None:  # noqa: ANN401  (any JSON)
        """Write down one action.

        Args:
            action: Such as "engage".
            caller: Who asked.
            result: "done", or why not.
            more: Old and new values and the like.
        """
        role = caller.role.name.lower()
        who = {"role": role, "token": caller.token_id, "address": caller.address}
        self.write({"action": action, **who, "result": result, **more})

    def write(self, entry: dict[str, Any]) -> None:
        """Write one line, with the time and the hash of the line before it.

        Args:
            entry: What it says; "action" names it.
        """
        try:
            with _alone(self._path):
                if _about(self._path) != self._left:
                    self._load()
                if self._resume:
                    self._append({"action": RESUME, **self._resume})
                    self._resume = {}
                self._rotate()
                self._append(entry)
                self._left = _about(self._path)
        except OSError:
            self.lost += 1

    def _append(self, entry: dict[str, Any]) -> None:
        now = datetime.now(UTC).isoformat(timespec="milliseconds")
        text = json.dumps({"time": now, **entry, "previous": self._previous}, separators=(",", ":"))
        data = (self._glue + text + "\n").encode("ascii")
        with self._path.open("ab", buffering=0) as stream:
            before = stream.seek(0, 2)
            if stream.write(data) != len(data):
                # a disk that filled up in the middle: half a line must not stay
                stream.truncate(before)
                raise OSError(errno.ENOSPC, "the disk is full")
        self._glue = ""
        self._previous = digest(text.encode("ascii"))
        self._seal(self._begins)

    def _rotate(self) -> None:
        if not self._path.exists() or self._path.stat().st_size <= self._largest:
            return
        first = next((line for line in _lines(self._path) if line.entry is not None), None)
        begins = "" if first is None else first.previous
        # both are right until the old file is gone
        self._seal((*self._begins[-1:], begins))
        self._path.replace(rotated(self._path))
        self._begins = (begins,)

    def _seal(self, begins: tuple[str, ...]) -> None:
        """Keep the newest hash beside the log; without it the log is whole all the same."""
        text = json.dumps({"head": self._previous, "begins": begins})
        path = head_path(self._path)
        temporary = path.with_name(path.name + ".new")
        try:
            temporary.write_text(text + "\n", encoding="ascii")
            temporary.replace(path)
        except OSError:
            self.unsealed += 1


@contextlib.contextmanager
def _alone(path: Path) -> Iterator[None]:
    """Nobody else writes meanwhile.

    Raises:
        OSError: Somebody else does not come to an end; the page has to go on.
    """
    with path.with_name(path.name + ".lock").open("ab") as lock:
        for _ in range(_TRIES):
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                time.sleep(_PAUSE)
        else:
            raise BlockingIOError(errno.EWOULDBLOCK, "another server holds the audit log")
        yield


def _about(path: Path) -> tuple[int, int]:
    """By which a file is known that somebody else has written to."""
    try:
        about = path.stat()
    except OSError:
        return (0, 0)
    return (about.st_ino, about.st_size)


def _lines(path: Path) -> list[Line]:
    try:
        return read_lines(path)
    except OSError:
        return []
