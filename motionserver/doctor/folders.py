"""The run directory, where the processes meet, and the state directory, which outlives a run."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from motionserver.doctor.finding import Finding, Level
from motionserver.doctor.mends import RUN_DIR
from motionserver.doctor.tree import Tree
from motionserver.supervisor.rundir import LONGEST_PATH, MARKER, foreign_content

RUN_SPACE: Final = 16 << 20
"""Free bytes for a run: a page of a mapped file that finds none kills its process."""
STATE_SPACE: Final = 64 << 20
"""Free bytes for audit, presets and recordings' heads."""
IN_MEMORY: Final = frozenset({"tmpfs", "ramfs"})
ELSEWHERE: Final = frozenset({"nfs", "nfs4", "cifs", "smb3", "9p", "virtiofs", "ceph", "vboxsf"})


@dataclass(frozen=True, slots=True)
class Folder:
    """What is known of a folder that the server will use.

    Attributes:
        path: Where it is, or will be made.
        exists: Whether it is there already.
        writable: Whether we may make files in it, or make it.
        mine: Whether it belongs to this user; True while it does not exist.
        free: Free space for this user [bytes]; None if the file system does not tell.
        kind: Kind of file system; None if it is not shown.
        mode: Permission bits; None while it does not exist.
        foreign: Names of files in it that are not the server's, when it has no marker of ours.
    """

    path: Path
    exists: bool
    writable: bool
    mine: bool
    free: int | None
    kind: str | None
    mode: int | None = None
    foreign: tuple[str, ...] = ()


def look_at(tree: Tree, path: Path) -> Folder:
    """Read what is known of a folder; nothing is written."""
    path = path.absolute()
    there = path
    # os.path: a folder we may not look into counts as not there, and cannot be made either
    while not os.path.exists(there) and there != there.parent:
        there = there.parent
    there = there.resolve()
    exists = os.path.exists(path)
    mount = tree.mount_of(there)
    free = None
    try:
        shown = os.statvfs(there)
        free = shown.f_bavail * shown.f_frsize
    except OSError:
        pass
    writable = there.is_dir() and os.access(there, os.W_OK | os.X_OK)
    state = path.stat() if exists else None
    return Folder(
        path,
        exists,
        writable and not (mount is not None and mount.read_only),
        state is None or state.st_uid == os.getuid(),
        free,
        None if mount is None else mount.kind,
        None if state is None else state.st_mode & 0o777,
        _foreign(path),
    )


def _foreign(path: Path) -> tuple[str, ...]:
    try:
        return tuple(foreign_content(path))
    except OSError:
        return ()


def run_directory(folder: Folder) -> Finding:
    """Whether the processes can meet there without waiting for a disk."""
    name = "run directory"
    move = RUN_DIR
    length = len(os.fsencode(folder.path))
    if length > LONGEST_PATH:
        return Finding(
            name, Level.PROBLEM,
            f"{folder.path}: {length} bytes long, sockets allow {LONGEST_PATH}",
            "the server will not start", move,
        )  # fmt: skip
    bad = _unusable(name, folder, RUN_SPACE, Level.PROBLEM, move)
    if bad is not None:
        return bad
    if folder.foreign:
        return Finding(
            name, Level.PROBLEM,
            f"{folder.path} holds {', '.join(folder.foreign[:4])} and no {MARKER} of ours",
            "the server will not start: a run would delete files there", move,
        )  # fmt: skip
    found = _words(folder)
    if folder.kind is None:
        return Finding(
            name, Level.UNKNOWN, found, "whether it lies in memory or on a disk is not shown", ""
        )
    if folder.kind in IN_MEMORY:
        return Finding(name, Level.OK, found, "guard and planner never wait for a disk")
    if folder.kind in ELSEWHERE:
        return Finding(
            name, Level.PROBLEM, found,
            "mapped files and locks across a network: the guard waits for another computer", move,
        )  # fmt: skip
    return Finding(
        name, Level.ADVICE, found,
        "a disk: while it writes a page back, the tick that touches the page waits", move,
    )  # fmt: skip


def state_directory(folder: Folder) -> Finding:
    """Whether tokens, presets and audit can be kept."""
    name = "state directory"
    move = f"export MOTIONSERVER_SERVER__STATE_DIR={Path.home() / 'motionserver'}"
    bad = _unusable(name, folder, STATE_SPACE, Level.WARNING, move)
    if bad is not None:
        return bad
    found = _words(folder)
    if folder.kind in IN_MEMORY:
        return Finding(
            name, Level.ADVICE, found, "tokens and presets are gone after a restart", move
        )
    return Finding(name, Level.OK, found, "tokens, presets and audit outlive a restart")


def _unusable(name: str, folder: Folder, space: int, short: Level, move: str) -> Finding | None:
    path = folder.path
    if not folder.mine:
        return Finding(
            name, Level.PROBLEM, f"{path} belongs to another user", "the server will not start",
            f'sudo chown "$USER" {path}',
        )  # fmt: skip
    if not folder.writable:
        return Finding(
            name, Level.PROBLEM, f"{path} cannot be {'written' if folder.exists else 'made'}",
            "the server will not start",
            f'sudo install -d -o "$USER" -m 0700 {path}',
        )  # fmt: skip
    if folder.free is not None and folder.free < space:
        return Finding(
            name, short, _words(folder) + f", {space / 2**20:g} MiB needed",
            "a full disk stops the processes or loses what they write",
            f"df -h {path if folder.exists else path.parent}, then make room; or {move}",
        )  # fmt: skip
    return None


def _words(folder: Folder) -> str:
    free = "space unknown" if folder.free is None else f"{folder.free / 2**20:.0f} MiB free"
    kind = folder.kind or "file system unknown"
    return f"{folder.path}{'' if folder.exists else ' (to be made)'}: {kind}, {free}"
