"""Files that hold secrets or a switch: there, readable, and by nobody else."""

from __future__ import annotations

import os
import stat
from dataclasses import dataclass
from pathlib import Path

from motionserver.doctor.finding import Finding, Level


@dataclass(frozen=True, slots=True)
class KeyFile:
    """What is known of such a file.

    Attributes:
        name: What it is for.
        path: Where it is.
        mode: Its permission bits; None if it is not there.
        readable: Whether this user may read it.
        hidden: Whether this user may not even look.
    """

    name: str
    path: Path
    mode: int | None
    readable: bool
    hidden: bool = False


def look_at_file(name: str, path: Path) -> KeyFile:
    """Read a file's permissions, never its content."""
    try:
        mode = stat.S_IMODE(path.stat().st_mode)
    except PermissionError:
        return KeyFile(name, path, None, False, True)
    except OSError:
        return KeyFile(name, path, None, False)
    return KeyFile(name, path, mode, os.access(path, os.R_OK))


def token_file(file: KeyFile) -> Finding:
    """The page's tokens: others must not read them, or the page does not start."""
    name = file.name
    if file.mode is None and not file.hidden:
        return Finding(name, Level.OK, f"{file.path}: not there yet", "made at the first start")
    bad = _unreadable(name, file, "the page does not start")
    if bad is not None:
        return bad
    assert file.mode is not None
    if file.mode & 0o077:
        return Finding(
            name, Level.PROBLEM, f"{file.path}: mode {file.mode:04o}",
            "others may read the tokens: the page does not start", f"chmod 600 {file.path}",
        )  # fmt: skip
    return Finding(name, Level.OK, f"{file.path}: mode {file.mode:04o}", "only this user reads it")


def secret_file(file: KeyFile) -> Finding:
    """A key of signed packets: others must not read it, or the server does not start."""
    return _key(
        file, 0o077, "others could read the key, and sign with it: the server does not start"
    )


def tls_key_file(file: KeyFile) -> Finding:
    """The key of the page's certificate: a secret that everybody can read stops the page."""
    return _key(file, 0o007, "every user may read the key: the page does not start")


def _key(file: KeyFile, forbidden: int, means: str) -> Finding:
    """A key with permission bits that are a problem; what else others may do is a warning."""
    name = file.name
    bad = _unreadable(name, file, "the server will not start")
    if bad is not None:
        return bad
    assert file.mode is not None
    found = f"{file.path}: mode {file.mode:04o}"
    if file.mode & forbidden:
        return Finding(name, Level.PROBLEM, found, means, f"chmod 600 {file.path}")
    if file.mode & 0o077:
        means = "others on this computer can read the secret, and use it"
        return Finding(name, Level.WARNING, found, means, f"chmod 600 {file.path}")
    return Finding(name, Level.OK, found, "only this user reads it")


def enable_switch(file: KeyFile) -> Finding:
    """The file of the enable switch: unreadable counts as released."""
    name = file.name
    bad = _unreadable(name, file, "counts as released: nobody can engage from the page")
    if bad is not None:
        return bad
    return Finding(name, Level.OK, f"{file.path}: readable", "read at each engage from the page")


def _unreadable(name: str, file: KeyFile, means: str) -> Finding | None:
    if file.mode is None:
        found = "not to be seen by this user" if file.hidden else "not there"
        return Finding(
            name, Level.PROBLEM, f"{file.path}: {found}", means, f"sudo ls -l {file.path}"
        )
    if not file.readable:
        return Finding(
            name, Level.PROBLEM, f"{file.path}: mode {file.mode:04o}, not readable by this user",
            means, f'sudo chown "$USER" {file.path}',
        )  # fmt: skip
    return None
