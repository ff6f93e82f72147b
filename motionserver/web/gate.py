"""What every request passes first: host, origin, kind and size of body; and the headers out."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from typing import Final

from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from motionserver.web.refusal import Refusal

MAX_BODY: Final = 64 * 1024
"""Largest request body [B]."""
_HOST: Final = re.compile(r"(\[[0-9a-f:.]+\]|[a-z0-9._-]+)(:[0-9]{1,5})?")
_READING: Final = frozenset({"GET", "HEAD"})
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
    """Refuses what no page of ours would send; a token in a header is asked for later.

    Args:
        app: What lies behind.
        host_names: Names the server may be asked under, against DNS rebinding.
        answered: Counts answers by status, for the metrics.
    """

    def __init__(self, app: ASGIApp, *, host_names: frozenset[str], answered: Counter[str]) -> None:
        self._app = app
        self._host_names = host_names
        self._answered = answered

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

        try:
            self._check(scope)
        except Refusal as refusal:
            await refusal.response()(scope, receive, guarded_send)
            return
        await self._app(scope, receive, guarded_send)

    def _check(self, scope: Scope) -> None:
        pairs = [(k.decode("latin-1"), v.decode("latin-1")) for k, v in scope["headers"]]
        headers = dict(pairs)
        path = str(scope["path"])
        hosts = [value for name, value in pairs if name == "host"]
        self._check_host(hosts, path)
        _check_origin(headers, hosts[0].lower(), scope["method"], path)
        _check_body(headers, scope["method"], path)

    def _check_host(self, hosts: list[str], path: str) -> None:
        match = _HOST.fullmatch(hosts[0].lower()) if len(hosts) == 1 else None
        if match is None or match[1] not in self._host_names:
            raise Refusal(
                400,
                "this server is not asked under that host name",
                path,
                "Host: " + ", ".join(sorted(self._host_names)),
                "use one of these names, or add the name to allowed_hosts",
            )


def _check_origin(headers: Mapping[str, str], host: str, method: str, path: str) -> None:
    origin = headers.get("origin")
    if origin is not None and origin.lower() not in (f"http://{host}", f"https://{host}"):
        raise _foreign("Origin", path)
    opened = method in _READING and not path.startswith(("/api/", "/metrics"))
    site = headers.get("sec-fetch-site", "none")
    if not opened and site not in ("same-origin", "none"):
        raise _foreign("Sec-Fetch-Site", path)


def _foreign(header: str, path: str) -> Refusal:
    return Refusal(
        403,
        f"{header} says that another site sent this",
        path,
        "requests of this server's own page, or of a program that sends no such header",
        "open the page under the server's own address",
    )


def _check_body(headers: Mapping[str, str], method: str, path: str) -> None:
    length = headers.get("content-length", "0")
    if not length.isdigit() or int(length) > MAX_BODY:
        raise too_large(path)
    has_body = length.strip("0") != "" or "transfer-encoding" in headers
    kind = headers.get("content-type", "").partition(";")[0].strip().lower()
    if method not in _READING and has_body and kind != "application/json":
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
