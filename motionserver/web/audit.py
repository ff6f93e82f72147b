"""Who changed what: one JSON line each, every line carrying the hash of the one before."""

from __future__ import annotations

import errno
import json
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


class Audit:
    """Appends to a file; a disk that refuses costs the line, never the request.

    The newest hash is kept in a file beside it, so that `motionserver audit verify` sees an end
    that was cut off. After a power cut it goes on behind what the cut left.

    Args:
        path: The file.
        largest: Size at which it is put aside [B].
    """

    def __init__(self, path: Path, largest: int = _LARGEST) -> None:
        self._path, self._largest = path, largest
        lines, older = _lines(path), _lines(rotated(path))
        whole = [line for line in (*older, *lines) if line.entry is not None]
        self._previous = whole[-1].digest if whole else ""
        self._begins: tuple[str, ...] = (whole[0].previous if whole else "",)
        self._resume = self._found(path, lines)
        # an end of line that is missing is given first, or the next line would stand on that one
        self._glue = "\n" if lines and not lines[-1].is_ended else ""
        self.lost = 0
        self.unsealed = 0

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
        who = {
            "role": caller.role.name.lower(),
            "token": caller.token_id,
            "address": caller.address,
            "result": result,
        }
        try:
            if self._resume:
                self._append({"action": RESUME, **self._resume})
                self._resume = {}
            self._rotate()
            self._append({"action": action, **who, **more})
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


def _lines(path: Path) -> list[Line]:
    try:
        return read_lines(path)
    except OSError:
        return []
