"""What a changing route takes, for its description in OpenAPI; the route itself checks it."""

from __future__ import annotations

from typing import Any

from motionserver.settings.fields import algorithms
from motionserver.settings.tuning import TuningModel

_VERSION = {
    "name": "If-Match",
    "in": "header",
    "required": True,
    "description": "The ETag of GET /api/tuning: who changes something must have seen it.",
    "schema": {"type": "string", "pattern": '^"[0-9]{1,15}"$'},
}


def versioned(extra: dict[str, Any] | None = None) -> dict[str, Any]:
    """A route that asks for the version in force."""
    return {"parameters": [_VERSION], **(extra or {})}


def takes_tunables(*, needed: bool) -> dict[str, Any]:
    """A route whose body names tunables and their values, as many as shall change."""
    schema = {k: v for k, v in TuningModel.model_json_schema().items() if k != "required"}
    return _takes(schema, needed=needed)


def takes_engines() -> dict[str, Any]:
    """A route whose body lists the side engines."""
    names = {"type": "array", "uniqueItems": True, "items": {"enum": list(algorithms())}}
    schema = {
        "type": "object",
        "properties": {"engines": names},
        "required": ["engines"],
        "additionalProperties": False,
    }
    return _takes(schema, needed=True)


def _takes(schema: dict[str, Any], *, needed: bool) -> dict[str, Any]:
    content = {"application/json": {"schema": schema}}
    return {"requestBody": {"required": needed, "content": content}}
