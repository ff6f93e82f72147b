"""Who asks: the token in the header, or a program on this computer that only looks."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from motionserver.web.attempts import Attempts
from motionserver.web.config import is_loopback
from motionserver.web.refusal import Refusal
from motionserver.web.tokens import SHORTEST, Role, Tokens

_FORWARDED: Final = (
    *("forwarded", "x-forwarded-for", "x-forwarded-host", "x-forwarded-proto"),
    *("x-real-ip", "x-client-ip", "true-client-ip", "via"),
)
"""Headers that a proxy adds."""


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


class Doorkeeper:
    """Tells who asks, from the token in the header or the address of the connection.

    Args:
        tokens: The known ones.
        attempts: Keeps guessers waiting.
    """

    def __init__(self, tokens: Tokens, attempts: Attempts) -> None:
        self._tokens = tokens
        self._attempts = attempts

    def admit(
        self,
        headers: Mapping[str, str],
        address: str,
        path: str,
        *,
        must_hold: bool,
        is_urgent: bool = False,
    ) -> Caller:
        """Let in who may at least look.

        Args:
            headers: Of the request, names in lower case.
            address: Of the peer of the connection; forwarding headers are never believed.
            path: Named in errors.
            must_hold: True if a token is needed. Else a program on this computer may look
                without one, unless its request went through a proxy.
            is_urgent: True if even a short token is taken whatever guesses came before it.

        Returns:
            The caller.

        Raises:
            Refusal: A stranger, or a wrong token (401); a guesser who has to wait (429).
        """
        given = headers.get("authorization")
        if given is None:
            local = is_loopback(address) and not any(name in headers for name in _FORWARDED)
            if must_hold or not local:
                raise unauthorised("a token is needed", path)
            return Caller(Role.VIEWER, "", address)
        scheme, _, token = given.partition(" ")
        found = self._tokens.role_of(token.strip()) if scheme.lower() == "bearer" else None
        wait = self._attempts.wait(address)
        # a short one may stand behind a hash in the file: only there guessing is worth anything
        is_long = len(token.strip()) >= SHORTEST
        if wait > 0.0 and not (found and (is_long or is_urgent)):
            raise _too_many(wait, path)
        if found is None:
            self._attempts.wrong(address)
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


def _too_many(wait: float, path: str) -> Refusal:
    return Refusal(
        429,
        "too many wrong tokens came from this address",
        path,
        "a few, then one now and then",
        "send the right one: one of full length is never held up",
        headers={"retry-after": str(math.ceil(wait))},
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
