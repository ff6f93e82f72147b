"""Whether a request comes from our own page: the names it asks under, and what a browser adds."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Final

from motionserver.web.refusal import Refusal

READING: Final = frozenset({"GET", "HEAD"})
_HOST: Final = re.compile(r"(\[[0-9a-f:.]+\]|[a-z0-9._-]+)(:[0-9]{1,5})?")
_ONCE: Final = frozenset(
    {
        *("host", "origin", "authorization", "if-match", "content-type", "content-length"),
        *("sec-fetch-site", "sec-fetch-mode", "sec-fetch-dest"),
    }
)
"""Headers that decide something: two of one could be read as one here and the other there."""


def is_public(method: str, path: str) -> bool:
    """Whether anybody may read this: the page's own files and the sign of life."""
    return method in READING and (path in ("/", "/healthz") or path.startswith("/static/"))


def single_headers(pairs: list[tuple[bytes, bytes]], path: str) -> dict[str, str]:
    """The headers by name, of which none that decides something may come twice.

    Raises:
        Refusal: One does, or the body has two lengths (400).
    """
    headers: dict[str, str] = {}
    for raw_name, raw_value in pairs:
        name, value = raw_name.decode("latin-1").lower(), raw_value.decode("latin-1")
        if name in headers and name in _ONCE:
            raise Refusal(400, f"the header {name} comes twice", path, f"one {name}", "send one")
        headers[name] = value
    if "transfer-encoding" in headers and "content-length" in headers:
        # a proxy in front may believe the other one, and see two requests where we see one
        raise Refusal(400, "the body has two lengths", path, "Content-Length", "send one")
    return headers


def check_host(headers: Mapping[str, str], names: frozenset[str], path: str) -> str:
    """The host asked for, in lower case, with its port; against DNS rebinding.

    Raises:
        Refusal: It is none of ``names`` (400).
    """
    host = headers.get("host", "").lower()
    match = _HOST.fullmatch(host)
    if match is None or match[1] not in names:
        raise Refusal(
            400,
            "this server is not asked under that host name",
            path,
            "Host: " + ", ".join(sorted(names)),
            "use one of these names, or add the name to allowed_hosts",
        )
    return host


def check_site(headers: Mapping[str, str], host: str, scheme: str, method: str, path: str) -> None:
    """Refuse what another site's page had sent; a link to the page is followed.

    Origin and Sec-Fetch-Site are written by the browser, and no script can change them. A program
    that is no browser sends neither, and must bring a token where one is needed.

    Args:
        headers: Of the request, names in lower case.
        host: As `check_host` gave it.
        scheme: Of the connection. On http the page may still have been loaded by https, through
            a proxy; never the other way round.
        method: GET and so on.
        path: Of the request.

    Raises:
        Refusal: Another site asks (403).
    """
    own = {f"https://{host}"} if scheme == "https" else {f"http://{host}", f"https://{host}"}
    origin = headers.get("origin")
    if origin is not None and origin.lower() not in own:
        raise _foreign("Origin", path)
    if headers.get("sec-fetch-site", "none") in ("same-origin", "none"):
        return
    followed = (headers.get("sec-fetch-mode"), headers.get("sec-fetch-dest"))
    if not (is_public(method, path) and followed == ("navigate", "document")):
        raise _foreign("Sec-Fetch-Site", path)


def _foreign(header: str, path: str) -> Refusal:
    return Refusal(
        403,
        f"{header} says that another site sent this",
        path,
        "requests of this server's own page, or of a program that sends no such header",
        "open the page under the server's own address",
    )
