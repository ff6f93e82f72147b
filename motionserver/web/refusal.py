"""Every error body: what, where, what is allowed, what to do."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from starlette.responses import Response


class Refusal(Exception):  # noqa: N818  (it is an answer, not an accident)
    """A request that is answered with no.

    Attributes:
        status: HTTP status.
        body: The JSON object of the answer.
        headers: Further response headers.
    """

    def __init__(
        self,
        status: int,
        error: str,
        where: str,
        allowed: str,
        do: str,
        *,
        headers: Mapping[str, str] | None = None,
        **more: object,
    ) -> None:
        super().__init__(error)
        self.status = status
        self.body = {"error": error, "where": where, "allowed": allowed, "do": do, **more}
        self.headers = dict(headers or {})

    def response(self) -> Response:
        """The answer itself."""
        return json_response(self.body, self.status, self.headers)


def json_response(
    data: object, status: int = 200, headers: Mapping[str, str] | None = None
) -> Response:
    """A JSON answer: plain ASCII, no NaN, never cached."""
    content = to_json(data)
    named = {"cache-control": "no-store", **(headers or {})}
    return Response(content, status, named, media_type="application/json")


def to_json(data: object) -> bytes:
    """Write ``data`` as JSON; what is not finite becomes null."""
    try:
        return json.dumps(data, allow_nan=False, separators=(",", ":")).encode()
    except ValueError:
        return json.dumps(_finite(data), allow_nan=False, separators=(",", ":")).encode()


def _finite(data: Any) -> Any:  # noqa: ANN401  (any JSON value)
    if isinstance(data, float):
        return data if math.isfinite(data) else None
    if isinstance(data, dict):
        return {str(key): _finite(value) for key, value in data.items()}
    if isinstance(data, (list, tuple)):
        return [_finite(value) for value in data]
    return data
