"""The run directory: taken by one server at a time, and left as it was found."""

from __future__ import annotations

import contextlib
import fcntl
import logging
import os
import stat
from pathlib import Path
from typing import Final, TextIO

from motionserver.errors import ConfigError
from motionserver.telemetry.blackbox.room import clear_room

log = logging.getLogger(__name__)
LEFT: Final = (
    *("*.map", "guard.sock", "planner.sock", "files.sock", "ask-*.sock"),
    *("config.json", "web.json", "tuning.json", "spare.lock", "last.json", "last.new"),
)
"""What a run leaves in its directory, but for the locks."""
MARKER: Final = ".motionserver-run"
"""Name of the file that marks a folder as a run directory."""
_MARKER_TEXT: Final = b"Run directory of motionserver. What lies here is deleted at every start.\n"
_SHOWN: Final = 4
"""Most names of somebody's files in an error."""
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
        refuse_foreign(run_dir)
        _mark(run_dir)
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
    """Delete what this or an earlier run left, so that nothing is taken for a running server.

    Without our marker nothing is deleted.
    """
    if foreign_content(run_dir):
        log.warning("%s has no %s any more: nothing in it is deleted", run_dir, MARKER)
        return
    for pattern in LEFT:
        for stale in run_dir.glob(pattern):
            stale.unlink(missing_ok=True)
    clear_room(run_dir)


def foreign_content(run_dir: Path) -> list[str]:
    """List what lies in a folder that is neither empty nor marked as a run directory.

    Returns:
        Names of its entries; empty if the folder may be used, or does not exist.

    Raises:
        OSError: The folder cannot be read.
    """
    try:
        names = sorted(os.listdir(run_dir))
    except FileNotFoundError:
        return []
    return [] if MARKER in names and _is_marker(run_dir / MARKER) else names


def refuse_foreign(run_dir: Path) -> None:
    """Refuse a folder that is somebody's.

    Raises:
        ConfigError: It holds something and has no marker of ours.
    """
    if names := foreign_content(run_dir):
        more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
        raise ConfigError(
            "[server] run_dir",
            f"{run_dir} holds {', '.join(names[:_SHOWN])}{more}, and no {MARKER} of ours: a run "
            "would delete files there; nothing was touched",
            "Name a folder that is empty or does not exist yet. If an earlier version of "
            "motionserver ran there and none runs now, delete the folder.",
        )


def _mark(run_dir: Path) -> None:
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
    with contextlib.suppress(FileExistsError):
        descriptor = os.open(run_dir / MARKER, flags, 0o600)
        with os.fdopen(descriptor, "wb") as file:
            file.write(_MARKER_TEXT)


def _is_marker(path: Path) -> bool:
    """Whether a file is the marker: a regular file of this user with our text, or still empty."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
        with os.fdopen(descriptor, "rb") as file:
            about = os.fstat(file.fileno())
            if not stat.S_ISREG(about.st_mode) or about.st_uid != os.getuid():
                return False
            return file.read(len(_MARKER_TEXT) + 1) in (b"", _MARKER_TEXT)
    except OSError:
        return False
