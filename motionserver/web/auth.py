"""Who may do what: three roles, three tokens, compared in constant time."""

from __future__ import annotations

import hashlib
import hmac
import json
import os
import secrets
import stat
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import Final

from motionserver.web.config import WebConfigError, is_loopback
from motionserver.web.refusal import Refusal

_FORWARDED: Final = ("forwarded", "x-forwarded-for", "x-real-ip", "via")


class Role(IntEnum):
    """What a request may do; each role may do what the lower ones may."""

    VIEWER = 1
    TUNER = 2
    OPERATOR = 3


@dataclass(frozen=True, slots=True)
class Caller:
    """Who sent a request.

    Attributes:
        role: What it may do.
        token_id: First eight hex digits of the token's hash, "" without a token.
        address: Its IP address.
    """

    role: Role
    token_id: str
    address: str


class Tokens:
    """The hashes of the three tokens; the tokens themselves are not kept."""

    def __init__(self, tokens: Mapping[Role, str]) -> None:
        self._hashes = {role: hashlib.sha256(t.encode()).digest() for role, t in tokens.items()}

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

    Raises:
        WebConfigError: Others may read it, or it does not hold three long tokens.
    """
    if not path.exists():
        fresh = {role.name.lower(): secrets.token_urlsafe(32) for role in Role}
        path.parent.mkdir(parents=True, exist_ok=True)
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(handle, "w", encoding="ascii") as stream:
            stream.write(json.dumps(fresh, indent=2) + "\n")
    mode = stat.S_IMODE(path.stat().st_mode)
    if mode & 0o077:
        raise WebConfigError(f"{path}: mode {mode:04o}, allowed 0600; do: chmod 600 {path}")
    try:
        data = json.loads(path.read_text(encoding="ascii"))
        tokens = {role: str(data[role.name.lower()]) for role in Role}
    except (ValueError, KeyError, TypeError) as error:
        raise WebConfigError(f"{path}: viewer, tuner and operator expected ({error!r})") from error
    if min(map(len, tokens.values())) < 32 or len(set(tokens.values())) < len(Role):
        raise WebConfigError(f"{path}: tokens must be different and at least 32 characters long")
    return Tokens(tokens)


def identify(tokens: Tokens, headers: Mapping[str, str], address: str, path: str) -> Caller | None:
    """Find out who asks.

    Args:
        tokens: The known ones.
        headers: Of the request, names in lower case.
        address: Of the peer of the connection; forwarding headers are never believed.
        path: Named in errors.

    Returns:
        The caller; None for a stranger without token. Without token only a program on this
        computer may look, and none whose request went through a proxy.

    Raises:
        Refusal: A token was sent and it is wrong (401).
    """
    given = headers.get("authorization")
    if given is None:
        local = is_loopback(address) and not any(name in headers for name in _FORWARDED)
        return Caller(Role.VIEWER, "", address) if local else None
    scheme, _, token = given.partition(" ")
    found = tokens.role_of(token.strip()) if scheme.lower() == "bearer" else None
    if found is None:
        raise unauthorised("the token is not known here", path)
    return Caller(*found, address)


def unauthorised(error: str, path: str) -> Refusal:
    """The 401 that says how to ask properly."""
    return Refusal(
        401,
        error,
        path,
        "Authorization: Bearer <token>",
        "send a token of the tokens file that the server made at its first start",
        headers={"www-authenticate": "Bearer"},
    )


def forbidden(role: Role, needed: Role, path: str) -> Refusal:
    """The 403 of a role that does not reach."""
    return Refusal(
        403,
        f"the role {role.name.lower()} may not do this",
        path,
        f"{needed.name.lower()} or higher",
        f"use the {needed.name.lower()} token",
    )
