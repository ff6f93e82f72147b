"""The annotated configuration file, rendered from the definitions of its sections."""

from __future__ import annotations

import json
import textwrap
import typing
from collections.abc import Iterator, Mapping
from typing import Any, Final

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from motionserver.settings.config import PREFIX, Config
from motionserver.settings.keys import EMPTY, EXAMPLE

_WIDTH: Final = 100
_HEAD: Final = (
    "Configuration of `motionserver run`. Every key stands here with its default, so deleting a "
    'line changes nothing; keys without a default stand behind a "#". Check yours with '
    "`motionserver check FILE`. Any key can also come from the environment, which wins: "
    f"{PREFIX}PLATFORM__RATE_HZ=60 is [platform] rate_hz. A mistake ends the start with status 2."
)


def annotated_config(values: Mapping[str, Mapping[str, object]] | None = None) -> str:
    """Render every key with its meaning, bounds and default.

    Args:
        values: Values that stand in for the defaults, by section and key.

    Returns:
        The file: TOML that means the defaults, but for ``values``.
    """
    blocks = [_comment(_HEAD)]
    for name, field in Config.model_fields.items():
        model, is_list = _section(field)
        chosen = (values or {}).get(name, {})
        tables: list[str] = []
        lines: list[str] = []
        for key, item in model.model_fields.items():
            if item.default == {}:
                tables.append(f"[{name}.{key}]\n{_about(item)}")
            else:
                lines += _key(key, item, chosen)
        head = f"[[{name}]]" if is_list else f"[{name}]"
        blocks.append("\n".join([_comment(model.__doc__ or ""), head, *lines]))
        blocks += tables
    return "\n\n".join(blocks) + "\n"


def _section(field: FieldInfo) -> tuple[type[BaseModel], bool]:
    """The model of a section, and whether there may be several of it."""
    inner = typing.get_args(field.annotation)
    model = inner[0] if inner else field.annotation
    assert isinstance(model, type)
    assert issubclass(model, BaseModel)
    return model, bool(inner)


def _key(name: str, item: FieldInfo, chosen: Mapping[str, object]) -> Iterator[str]:
    yield _about(item)
    if name in chosen:
        yield f"{name} = {toml_value(chosen[name])}"
    elif item.default is None:
        yield f"# {name} = {toml_value(_extra(item)[EXAMPLE])}"
    else:
        yield f"{name} = {toml_value(item.default)}"


def _about(item: FieldInfo) -> str:
    """Meaning, bounds and default, as a comment."""
    description = str(item.description).strip()
    words = []
    low, high = _bounds(item)
    if low is not None and high is not None:
        words.append(f"Allowed: {low:g} to {high:g}.")
    *others, last = [toml_value(choice) for choice in _choices(item)] or [""]
    if any(choice not in description for choice in (*others, last)):
        words.append(f"Allowed: {', '.join(others)} or {last}.")
    empty = str(_extra(item)[EMPTY])
    if item.default is None or item.default == {}:
        words.append(f"Default: {empty}.")
    else:
        words.append(f"Default {toml_value(item.default)}" + (f": {empty}." if empty else "."))
    return _comment(description, *words)


def _bounds(item: FieldInfo) -> tuple[float | None, float | None]:
    """Least and largest value of a number, or of the number an optional key may be."""
    parts = list(item.metadata)
    for inner in typing.get_args(item.annotation):
        for part in typing.get_args(inner)[1:]:
            parts += getattr(part, "metadata", [])
    low = next((float(part.ge) for part in parts if hasattr(part, "ge")), None)
    high = next((float(part.le) for part in parts if hasattr(part, "le")), None)
    return low, high


def _choices(item: FieldInfo) -> tuple[object, ...]:
    is_closed = typing.get_origin(item.annotation) is typing.Literal
    return typing.get_args(item.annotation) if is_closed else ()


def _extra(item: FieldInfo) -> dict[str, Any]:
    return item.json_schema_extra if isinstance(item.json_schema_extra, dict) else {}


def _comment(*parts: str) -> str:
    """Parts as one comment, wrapped; a part with line breaks keeps its own."""
    if any("\n" in part for part in parts):
        lines = [line.rstrip() for part in parts for line in part.splitlines()]
        return "\n".join(f"# {line}" for line in lines)
    return textwrap.fill(
        " ".join(parts),
        _WIDTH,
        initial_indent="# ",
        subsequent_indent="# ",
        break_long_words=False,
        break_on_hyphens=False,
    )


def toml_value(value: object) -> str:
    """A value as TOML writes it.

    Raises:
        TypeError: It is no value of a configuration.
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        # JSON escapes a subset of what TOML reads, but for DEL
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, list | tuple):
        return f"[{', '.join(toml_value(one) for one in value)}]"
    raise TypeError(f"{value!r} cannot be a value of the configuration")
