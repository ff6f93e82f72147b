"""What the routes share: who asks, whom to ask, where it is written down."""

from __future__ import annotations

import asyncio
import json
from dataclasses import dataclass
from typing import Any, Final, cast

from fastapi import Request
from starlette.requests import ClientDisconnect

from motionserver.settings.tuning_presets import PresetShelf
from motionserver.web.audit import Audit
from motionserver.web.auth import Caller, forbidden, unauthorised
from motionserver.web.config import WebConfig
from motionserver.web.gate import MAX_BODY, too_large
from motionserver.web.refusal import Refusal
from motionserver.web.refusals import Refusals
from motionserver.web.requests import Peer
from motionserver.web.tokens import Role

_PATIENCE: Final = 5.0
"""Time a body may take to arrive [s]."""


@dataclass(frozen=True, slots=True)
class Desk:
    """Everything a route needs.

    Attributes:
        config: Of this process.
        guard: Takes engage, park, reset.
        planner: Takes changes of the tuning.
        presets: Named tunings.
        audit: Who changed what.
        refusals: Who was refused.
    """

    config: WebConfig
    guard: Peer
    planner: Peer
    presets: PresetShelf
    audit: Audit
    refusals: Refusals

    def require(self, request: Request, role: Role) -> Caller:
        """Let through who may do this; who it is was found out at the gate.

        Args:
            request: The request.
            role: Least role.

        Raises:
            Refusal: A stranger (401), or a role that does not reach (403).
        """
        caller: Caller | None = getattr(request.state, "caller", None)
        if caller is None:
            raise unauthorised("a token is needed", request.url.path)
        if caller.role < role:
            refusal = forbidden(caller.role, role, request.url.path)
            self.refusals.note(refusal, request.method, request.url.path, caller)
            raise refusal
        return caller


async def read_json(request: Request, empty: dict[str, Any] | None = None) -> dict[str, Any]:
    """Read a JSON object, bounded in size and in time.

    Args:
        request: Whose body it is.
        empty: What no body at all means; None = not allowed.

    Raises:
        Refusal: Too large (413), too slow (408), no JSON (400) or no object (422).
    """
    path = request.url.path
    try:
        async with asyncio.timeout(_PATIENCE):
            body = await _body(request)
    except ClientDisconnect:
        # nobody reads the answer; it is counted like any other
        raise Refusal(400, "the client left before its body was complete", path,
                      "as many bytes as announced", "send the whole body") from None  # fmt: skip
    except TimeoutError:
        raise Refusal(408, "the body did not arrive", path, f"within {_PATIENCE:g} s",
                      "send it at once", headers={"connection": "close"}) from None  # fmt: skip
    if not body and empty is not None:
        return empty
    try:
        data = json.loads(body)
    except (ValueError, RecursionError):
        raise Refusal(400, "the body is not JSON", path, "a JSON object in UTF-8",
                      "check quotes, commas and brackets") from None  # fmt: skip
    if not isinstance(data, dict):
        raise Refusal(422, "the body is not a JSON object", path, '{"name": value, ...}',
                      "send names and values", details=[])  # fmt: skip
    return cast("dict[str, Any]", data)


async def _body(request: Request) -> bytes:
    body = bytearray()
    async for chunk in request.stream():
        body += chunk
        if len(body) > MAX_BODY:
            raise too_large(request.url.path)
    return bytes(body)
