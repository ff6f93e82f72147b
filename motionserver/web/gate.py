"""What every request passes first: names, site, token, load, body; and the headers out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Final

from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from motionserver.web.auth import Doorkeeper
from motionserver.web.refusal import Refusal
from motionserver.web.refusals import Refusals
from motionserver.web.site import READING, check_host, check_site, is_public, single_headers

MAX_BODY: Final = 64 * 1024
"""Largest request body [B]."""
MOST_AT_ONCE: Final = 64
"""Requests that are answered at a time, streams among them."""
PARK: Final = "/api/park"
"""Parking finds room beyond that, and takes a short token whatever guesses came before it."""
_ROOM_TO_PARK: Final = 16
_SECURITY: Final = {
    "content-security-policy": "default-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'; object-src 'none'",
    "x-frame-options": "DENY",
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), geolocation=(), microphone=()",
}


class Gate:
    """Refuses what no page of ours would send, and strangers; a route only asks for the role.

    Args:
        app: What lies behind.
        host_names: Names the server may be asked under, against DNS rebinding.
        doorkeeper: Tells who asks.
        answered: Counts answers by status, for the metrics.
        refusals: Writes down who was refused.
    """

    def __init__(
        self,
        app: ASGIApp,
        *,
        host_names: frozenset[str],
        doorkeeper: Doorkeeper,
        answered: Counter[str],
        refusals: Refusals,
    ) -> None:
        self._app = app
        self._host_names = host_names
        self._doorkeeper = doorkeeper
        self._answered = answered
        self._refusals = refusals
        self._open = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Check one request and pass it on."""
        if scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})
            return
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        async def guarded_send(message: Message) -> None:
            if message["type"] == "http.response.start":
                self._answered[str(message["status"])] += 1
                headers = MutableHeaders(scope=message)
                for name, value in _SECURITY.items():
                    headers[name] = value
                if scope["scheme"] == "https":
                    headers["strict-transport-security"] = "max-age=31536000"
            await send(message)

        self._open += 1
        try:
            self._check(scope)
            await self._app(scope, receive, guarded_send)
        except Refusal as refusal:
            client = scope.get("client")
            who = client[0] if client else ""
            self._refusals.note(refusal, scope["method"], scope["path"], who)
            await refusal.response()(scope, receive, guarded_send)
        finally:
            self._open -= 1

    def _check(self, scope: Scope) -> None:
        method, path = str(scope["method"]), str(scope["path"])
        headers = single_headers(scope["headers"], path)
        host = check_host(headers, self._host_names, path)
        check_site(headers, host, scope["scheme"], method, path)
        if not is_public(method, path):
            client = scope.get("client")
            caller = self._doorkeeper.admit(
                headers,
                client[0] if client else "",
                path,
                must_hold=method not in READING,
                is_urgent=path == PARK,
            )
            scope.setdefault("state", {})["caller"] = caller
        if self._open > MOST_AT_ONCE + (_ROOM_TO_PARK if path == PARK else 0):
            raise _busy(path)
        _check_body(headers, method, path)


def _busy(path: str) -> Refusal:
    return Refusal(
        503,
        "too many requests at once",
        path,
        f"{MOST_AT_ONCE} at a time",
        "close other pages, wait a moment and repeat",
        headers={"retry-after": "1"},
    )


def _check_body(headers: Mapping[str, str], method: str, path: str) -> None:
    length = headers.get("content-length", "0")
    if not (length.isascii() and length.isdigit() and len(length) < 16 and int(length) <= MAX_BODY):
        raise too_large(path)
    has_body = int(length) > 0 or "transfer-encoding" in headers
    kind = headers.get("content-type", "").partition(";")[0].strip().lower()
    if method not in READING and has_body and kind != "application/json":
        raise Refusal(
            415,
            "the body is not announced as JSON",
            path,
            "Content-Type: application/json",
            "send the header, and JSON",
        )


def too_large(path: str) -> Refusal:
    """The 413 of a body that is too long."""
    return Refusal(
        413, "the body is too large", path, f"at most {MAX_BODY} bytes", "send less",
        headers={"connection": "close"},
    )  # fmt: skip
