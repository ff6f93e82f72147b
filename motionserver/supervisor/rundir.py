"""The run directory: taken by one server at a time, and left as it was found."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path
from typing import Final, TextIO

from motionserver.errors import ConfigError
from motionserver.telemetry.blackbox.room import clear_room

LEFT: Final = (
    *("*.map", "guard.sock", "planner.sock", "ask-*.sock"),
    *("config.json", "web.json", "tuning.json"),
)
"""What a run leaves in its directory, but for the locks."""
LONGEST_PATH: Final = 70
"""Longest run directory [bytes]: a unix socket's path has 108 at most."""


def take(run_dir: Path) -> TextIO:
    """Make the run directory ours alone, and lock it.

    Raises:
        ConfigError: It cannot be used, or another server runs there.
    """
    where, other = "[server] run_dir", "Choose another folder."
    if len(os.fsencode(run_dir.absolute())) > LONGEST_PATH:
        raise ConfigError(where, f"{run_dir} is too long a path for sockets", other)
    try:
        run_dir.mkdir(mode=0o700, parents=True, exist_ok=True)
        if run_dir.stat().st_uid != os.getuid():
            raise ConfigError(where, f"{run_dir} belongs to somebody else", other)
        run_dir.chmod(0o700)
        lock = (run_dir / "service.lock").open("w")
    except OSError as error:
        raise ConfigError(where, f"{run_dir}: {error.strerror}", other) from error
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        lock.close()
        raise ConfigError(
            where,
            f"another server runs in {run_dir}",
            "Stop it first: one platform has one server.",
        ) from error
    return lock


def clean(run_dir: Path) -> None:
    """Nothing of this or an earlier run may be taken for a living server."""
    for pattern in LEFT:
        for stale in run_dir.glob(pattern):
            stale.unlink(missing_ok=True)
    clear_room(run_dir)
