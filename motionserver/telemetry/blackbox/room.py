"""Where the histories lie, and how large they are."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from math import ceil
from pathlib import Path
from typing import Final

from motionserver.telemetry.blackbox.history import History
from motionserver.telemetry.blackbox.records import GUARD, KEPT, PACKET
from motionserver.telemetry.link import PLAN_BYTES

FOLDER: Final = "blackbox"
"""In the run directory: a folder, or a link to one in memory."""
EVENT_BYTES: Final = 3072
PERIOD_BYTES: Final = 1280
PACKETS_PER_SECOND: Final = 250
"""Believed packets per second that still leave a whole minute."""
_PLANS: Final = 32
_EVENTS: Final = 512
_MEMORY: Final = Path("/dev/shm")
_PREFIX: Final = "motionserver-"
_IN_MEMORY: Final = ("tmpfs", "ramfs")


def make_room(run_dir: Path, rate_hz: float, plan_hz: float) -> None:
    """Make the histories of one run, in memory even where the run directory is on a disk.

    A page of a file on a disk may have to wait for the disk when it is written; the guard must not.

    Args:
        run_dir: Where the processes meet.
        rate_hz: Packets to the platform [Hz].
        plan_hz: Plans [Hz].

    Raises:
        OSError: There is no room; nothing is left behind.
    """
    folder = run_dir / FOLDER
    clear_room(run_dir)
    if not _is_in_memory(run_dir) and os.access(_MEMORY, os.W_OK):
        folder.symlink_to(tempfile.mkdtemp(prefix=_PREFIX, dir=_MEMORY))
    else:
        folder.mkdir(mode=0o700)
    periods = ceil(KEPT * plan_hz)
    try:
        for name, capacity, slots in (
            ("guard", GUARD.size, ceil(KEPT * rate_hz) + periods),
            ("guard_events", EVENT_BYTES, _EVENTS),
            ("accepted", PLAN_BYTES, _PLANS),
            ("proposed", PLAN_BYTES, _PLANS),
            ("packets", PACKET.size, ceil(KEPT * PACKETS_PER_SECOND)),
            ("periods", PERIOD_BYTES, periods),
            ("planner_events", EVENT_BYTES, _EVENTS),
        ):
            History.create(folder / f"{name}.history", capacity, slots).close()
    except OSError:
        clear_room(run_dir)
        raise


def clear_room(run_dir: Path) -> None:
    """Remove what a run left, wherever it lay."""
    folder = run_dir / FOLDER
    with contextlib.suppress(OSError):
        if folder.is_symlink():
            free_memory(folder.resolve())
            folder.unlink()
    shutil.rmtree(folder, ignore_errors=True)


def free_memory(room: Path) -> None:
    """Remove histories that lie in memory but outside the run directory."""
    if room.parent == _MEMORY and room.name.startswith(_PREFIX):
        shutil.rmtree(room, ignore_errors=True)


def _is_in_memory(path: Path) -> bool:
    """True if the file system of ``path`` is one in memory."""
    best, kind = "", ""
    try:
        mounts = Path("/proc/self/mounts").read_text("utf-8", "replace").splitlines()
    except OSError:
        return False
    here = str(path.resolve())
    for mount in mounts:
        _, where, what, *_ = mount.split(" ")
        if (here == where or here.startswith(where.rstrip("/") + "/")) and len(where) >= len(best):
            best, kind = where, what
    return kind in _IN_MEMORY
