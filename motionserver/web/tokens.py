"""The three tokens and what each allows: hashes in memory, a file that only we can read."""

from __future__ import annotations

import hashlib
import hmac
import json
import os
import re
import secrets
import stat
from collections.abc import Mapping
from enum import IntEnum
from pathlib import Path
from typing import Final

from motionserver.bounded_files import read_with_status
from motionserver.web.config import WebConfigError

_HASHED: Final = "sha256:"
_DIGEST: Final = re.compile(r"[0-9a-f]{64}")
SHORTEST: Final = 32
"""Shortest token [characters]."""
_LARGEST: Final = 4096
"""Largest tokens file that is read [B]."""


class Role(IntEnum):
    """What a request may do; each role may do what the lower ones may."""

    VIEWER = 1
    TUNER = 2
    OPERATOR = 3


class Tokens:
    """The hashes of the three tokens; the tokens themselves are not kept.

    Args:
        hashes: SHA-256 of each role's token.
    """

    def __init__(self, hashes: Mapping[Role, bytes]) -> None:
        self._hashes = dict(hashes)

    def role_of(self, token: str) -> tuple[Role, str] | None:
        """Role and short id of a token; takes as long for a wrong one as for a right one."""
        given = hashlib.sha256(token.encode("utf-8", "surrogateescape")).digest()
        found = None
        for role, known in self._hashes.items():
            if hmac.compare_digest(given, known):
                found = (role, known.hex()[:8])
        return found


def load_tokens(path: Path) -> Tokens:
    """Read the tokens file, or make it with three fresh 256-bit tokens, mode 0600.

    An entry is a token, or "sha256:" and the 64 hex digits of its hash; then the file does not
    tell the token to whoever reads a copy of it.

    Raises:
        WebConfigError: Others may read it, it is not ours, or it does not hold three long tokens.
    """
    try:
        if not path.exists():
            _make(path)
        text, about = read_with_status(path, _LARGEST)
    except OSError as error:
        raise WebConfigError(f"{path}: {error.strerror}; it must be ours to read") from error
    mode = stat.S_IMODE(about.st_mode)
    if mode & 0o077:
        raise WebConfigError(f"{path}: mode {mode:04o}, allowed 0600; do: chmod 600 {path}")
    if about.st_uid not in (os.getuid(), 0):
        raise WebConfigError(f"{path}: belongs to user {about.st_uid}, who could change it; "
                             f"do: chown {os.getuid()} {path}")  # fmt: skip
    try:
        data = json.loads(text)
        hashes = {role: _hash_of(str(data[role.name.lower()])) for role in Role}
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        # without the cause: it may quote what the file says
        raise WebConfigError(
            f"{path}: viewer, tuner and operator expected, each a token of at least {SHORTEST} "
            f"characters, or {_HASHED} and 64 hex digits"
        ) from error
    if len(set(hashes.values())) < len(Role):
        raise WebConfigError(f"{path}: the three tokens must be different")
    return Tokens(hashes)


def _make(path: Path) -> None:
    fresh = {role.name.lower(): secrets.token_urlsafe(32) for role in Role}
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(handle, "w", encoding="ascii") as stream:
        stream.write(json.dumps(fresh, indent=2) + "\n")


def _hash_of(entry: str) -> bytes:
    if entry.startswith(_HASHED):
        if not _DIGEST.fullmatch(entry.removeprefix(_HASHED)):
            raise ValueError("not 64 hex digits")
        return bytes.fromhex(entry.removeprefix(_HASHED))
    if len(entry) < SHORTEST:
        raise ValueError("too short")
    return hashlib.sha256(entry.encode()).digest()
