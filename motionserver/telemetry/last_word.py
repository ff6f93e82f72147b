"""What the guard showed last, in a plain file: it outlives a server that is killed altogether."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path
from typing import Any, Final

from motionserver.bounded_files import read_bounded

NAME: Final = "last.json"
_LARGEST: Final = 4096
_SHOWN: Final = ("t_ns", "state", "reason")


def write_last_word(run_dir: Path, snapshot: dict[str, Any]) -> None:
    """Write it; a disk that is full, or a directory that is gone, keeps the older one or none."""
    path = run_dir / NAME
    temporary = path.with_suffix(".new")
    with contextlib.suppress(OSError):
        temporary.write_text(json.dumps({name: snapshot[name] for name in _SHOWN}), "utf-8")
        temporary.replace(path)


def read_last_word(run_dir: Path) -> dict[str, Any] | None:
    """Instant, state and reason; None if nothing was left that can be read."""
    try:
        found = json.loads(read_bounded(run_dir / NAME, _LARGEST))
        return {"t_ns": int(found["t_ns"]), **{name: str(found[name]) for name in _SHOWN[1:]}}
    except (OSError, ValueError, LookupError, TypeError):
        return None
