"""Reading the key that packets are signed with: long enough, and nobody else's to read."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import Final

from motionserver.bounded_files import read_with_status
from motionserver.errors import ConfigError

SHORTEST_KEY: Final = 16
"""Fewest bytes of a key."""
LONGEST_KEY: Final = 4096
"""Most bytes of a key."""


def read_key(path: Path, where: str) -> bytes:
    """Read a key.

    Args:
        path: Its file; the key is its bytes, exactly as they are.
        where: The setting, named in errors.

    Raises:
        ConfigError: It cannot be read or is too short, or somebody else may read or change it.
    """
    try:
        key, about = read_with_status(path, LONGEST_KEY)
    except OSError as error:
        raise ConfigError(
            where,
            f"{path} cannot be read ({error.strerror})",
            f"Give a regular file of {SHORTEST_KEY} to {LONGEST_KEY} bytes.",
        ) from error
    mode = stat.S_IMODE(about.st_mode)
    if mode & 0o077:
        raise ConfigError(
            where,
            f"{path}: mode {mode:04o} lets others on this computer read the key, and sign with it",
            f"Do: chmod 600 {path}",
        )
    if about.st_uid not in (os.getuid(), 0):
        raise ConfigError(
            where,
            f"{path}: belongs to user {about.st_uid}, who could change it",
            f"Do: sudo chown {os.getuid()} {path}",
        )
    if len(key) < SHORTEST_KEY:
        raise ConfigError(
            where,
            f"{path}: {len(key)} bytes",
            f"Give at least {SHORTEST_KEY} random bytes, for example from /dev/urandom.",
        )
    return key
