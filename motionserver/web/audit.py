"""Who changed what: one JSON line each, every line carrying the hash of the one before."""

from __future__ import annotations

import hashlib
import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from motionserver.web.auth import Caller

_LARGEST: Final = 4 * 1024 * 1024
"""Size at which the file is put aside as `.1` [B]."""


class Audit:
    """Appends to a file; a disk that refuses costs the line, never the request.

    Args:
        path: The file.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._previous = _last_hash(path)
        self.lost = 0

    def note(self, action: str, caller: Caller, result: str, **more: Any) -> None:  # noqa: ANN401  (any JSON)
        """Write down one action.

        Args:
            action: Such as "engage".
            caller: Who asked.
            result: "done", or why not.
            more: Old and new values and the like.
        """
        entry = {
            "time": datetime.now(UTC).isoformat(timespec="milliseconds"),
            "action": action,
            "role": caller.role.name.lower(),
            "token": caller.token_id,
            "address": caller.address,
            "result": result,
            **more,
            "previous": self._previous,
        }
        line = json.dumps(entry, separators=(",", ":"))
        try:
            if self._path.exists() and self._path.stat().st_size > _LARGEST:
                self._path.replace(self._path.with_name(self._path.name + ".1"))
            with self._path.open("a", encoding="ascii") as stream:
                stream.write(line + "\n")
        except OSError:
            self.lost += 1
            return
        self._previous = _hash(line)


def _hash(line: str) -> str:
    return hashlib.sha256(line.encode()).hexdigest()


def _last_hash(path: Path) -> str:
    try:
        lines = path.read_text(encoding="ascii").splitlines()
    except (OSError, ValueError):
        return ""
    return _hash(lines[-1]) if lines else ""
