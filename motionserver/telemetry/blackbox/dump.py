"""One dump: what the histories hold, put together, and written so that it is whole or not there."""

from __future__ import annotations

import contextlib
import gzip
import json
import os
import re
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, Final

from motionserver import __version__
from motionserver.core.plan import unpack
from motionserver.telemetry.blackbox.history import open_history
from motionserver.telemetry.blackbox.records import GUARD, KEPT, PACKET, Layout
from motionserver.telemetry.blackbox.room import FOLDER
from motionserver.telemetry.mapped import MappedFile
from motionserver.telemetry.run_files import located, read_run_file
from motionserver.telemetry.trace import Trace

FORMAT: Final = "motionserver blackbox 1"
SUFFIX: Final = ".json.gz"
_PART: Final = ".part"
_NAME: Final = re.compile(r"\d{8}T\d{6}\.\d{3}Z-[a-z0-9-]*\.json\.gz(\.part)?")
"""Name of a dump, or of the part of one; nothing else in its folder is ever deleted."""
_SHOWN: Final = ("guard", "planner", "service")


@dataclass(frozen=True, slots=True)
class Trigger:
    """Why something is written down.

    Attributes:
        t_ns: When it happened, CLOCK_MONOTONIC [ns].
        slug: For the file's name: a state, or who died.
        text: In words.
    """

    t_ns: int
    slug: str
    text: str


def collect(
    run_dir: Path, triggers: Sequence[Trigger], now_ns: int, utc: datetime
) -> dict[str, Any]:
    """Read everything of the last minute.

    Args:
        run_dir: Where the processes meet.
        triggers: Why.
        now_ns: Now, CLOCK_MONOTONIC [ns].
        utc: The same instant by the wall clock.
    """

    def box(name: str) -> Path:
        return located(run_dir, f"{FOLDER}/{name}.history")

    since = min(trigger.t_ns for trigger in triggers) - int(KEPT * 1e9)
    return {
        "format": FORMAT,
        "version": __version__,
        "made_utc": utc.isoformat(timespec="milliseconds"),
        "made_ns": now_ns,
        "reasons": [{"t_ns": one.t_ns, "text": one.text} for one in triggers],
        "config": _config(run_dir),
        **{name: _shown(located(run_dir, f"{name}.map")) for name in _SHOWN},
        "guard_rows": _table(box("guard"), GUARD, since),
        "packets": _table(box("packets"), PACKET, since),
        "periods": _objects(box("periods"), _period, since),
        "guard_events": _objects(box("guard_events"), json.loads, since),
        "planner_events": _objects(box("planner_events"), json.loads, since),
        "accepted": _objects(box("accepted"), _plan, 0),
        "proposed": _objects(box("proposed"), _plan, 0),
    }


def _table(path: Path, layout: Layout, since_ns: int) -> dict[str, Any]:
    rows = _objects(path, layout.row, 0)
    return {"columns": layout.names, "rows": [row for row in rows if row[0] >= since_ns]}


def _objects(path: Path, read: Callable[[bytes], Any], since_ns: int) -> list[Any]:
    """Messages of a history that can be read; of mappings, those after an instant."""
    history = open_history(path)
    if history is None:
        return []
    out = []
    for _, data in history.since():
        with contextlib.suppress(ValueError, LookupError, TypeError, struct.error):
            one = read(data)
            if not since_ns or one["t_ns"] >= since_ns:
                out.append(one)
    history.close()
    return out


def _period(data: bytes) -> dict[str, Any]:
    trace = Trace.unpack(data)
    return {name: getattr(trace, name) for name in trace.__slots__}


def _plan(data: bytes) -> dict[str, Any]:
    plan = unpack(data)
    out: dict[str, Any] = {
        "plan_id": plan.plan_id,
        "parent_id": plan.parent_id,
        "takeover_s": plan.takeover,
    }
    for name in ("times", "pose", "velocity", "acceleration"):
        out[name] = getattr(plan, name).round(9).tolist()
    return out


def _shown(path: Path) -> Any:  # noqa: ANN401  (any JSON)
    try:
        mapped = MappedFile(path)
        message = mapped.read()
        mapped.close()
        return None if message is None else json.loads(message[1])
    except (OSError, ValueError):
        return None


def _config(run_dir: Path) -> Any:  # noqa: ANN401  (any JSON)
    """What the processes were told, without the keys that sign packets."""
    try:
        data = json.loads(read_run_file(run_dir, "config.json"))
        for source in data["sources"]:
            source["key"] = "set" if source["key"] else ""
    except (OSError, ValueError, LookupError, TypeError):
        return None
    return data


def write_dump(folder: Path, data: dict[str, Any], slug: str, utc: datetime, kept: int) -> Path:
    """Write a dump, and remove the oldest beyond ``kept``.

    Args:
        folder: Where dumps lie; made if it is not there.
        data: What `collect` made.
        slug: Goes into the name.
        utc: Goes into the name.
        kept: How many dumps may lie there, this one included.

    Returns:
        Its path.

    Raises:
        OSError: It cannot be written; nothing of it is left.
    """
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    for part in _named(folder, _PART):
        part.unlink(missing_ok=True)
    path = folder / f"{utc:%Y%m%dT%H%M%S}.{utc.microsecond // 1000:03d}Z-{slug}{SUFFIX}"
    part = path.with_name(path.name + _PART)
    try:
        with part.open("wb") as file:
            os.fchmod(file.fileno(), 0o600)
            file.write(gzip.compress(json.dumps(data, separators=(",", ":")).encode(), 6))
            file.flush()
            os.fsync(file.fileno())
        part.rename(path)
    except OSError:
        part.unlink(missing_ok=True)
        raise
    directory = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(directory)
    finally:
        os.close(directory)
    # by name, but never the new one: the wall clock may have been set back
    older = [one for one in dumps(folder) if one != path]
    for one in older[: max(0, len(older) + 1 - kept)]:
        one.unlink(missing_ok=True)
    return path


def dumps(folder: Path) -> list[Path]:
    """All dumps, oldest first."""
    return _named(folder, SUFFIX)


def _named(folder: Path, ending: str) -> list[Path]:
    return sorted(path for path in folder.glob(f"*{ending}") if _NAME.fullmatch(path.name))


def slug_of(text: str) -> str:
    """A text as part of a file name."""
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")[:48].strip("-")
