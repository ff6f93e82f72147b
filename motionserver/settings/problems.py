"""From a validation error to words: file, line, key, what is allowed, what to do."""

from __future__ import annotations

import difflib
import re
import tomllib
from pathlib import Path
from typing import Any, Final

from pydantic import BaseModel, ValidationError

from motionserver.errors import ConfigError

_SHOWN: Final = 80
"""Most characters of a wrong value that are shown."""
_WHERE: Final = 300
"""Most characters of a place that are shown."""


def read_toml(text: str, where: str) -> dict[str, Any]:
    """Read TOML, whatever stands in it.

    Args:
        text: What to read.
        where: The file, for the error.

    Raises:
        ConfigError: It is no TOML.
    """
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ConfigError(
            where, "not TOML: brackets nested too deeply", "Correct the syntax."
        ) from None
    except ValueError as error:  # a number of thousands of digits is no TOMLDecodeError
        raise ConfigError(where, f"not TOML: {error}", "Correct the syntax.") from error


def unknown_key(where: str, key: str, known: list[str], tail: str = "") -> ConfigError:
    """Word the refusal of a key that does not exist, with the most similar one that does."""
    close = difflib.get_close_matches(key, known, 1)
    hint = f"Did you mean {close[0]!r}?" if close else f"Allowed: {', '.join(known)}."
    return ConfigError(where[:_WHERE], f"unknown key {key[:_SHOWN]!r}", hint + tail)


def config_error(
    error: ValidationError, path: Path | None, text: str, model: type[BaseModel]
) -> ConfigError:
    """Word the most telling problem of a validation error.

    Args:
        error: What pydantic found.
        path: The file, if the values came from one.
        text: Its content, to find the line.
        model: The model, to suggest a key that exists.

    Returns:
        The error to raise.
    """
    # a mistyped key is missing as well: say what was typed
    first = min(error.errors(), key=lambda found: found["type"] != "extra_forbidden")
    place = first["loc"]
    keys = [str(part) for part in place]
    where = place_in_file(path, text, place)
    more = len(error.errors()) - 1
    tail = f" ({more} more after this one)" if more else ""
    if first["type"] == "extra_forbidden":
        return unknown_key(where, keys[-1], _known(model, place[:-1]), tail)
    found = first.get("input")
    shown = "" if isinstance(found, dict | list) else f", found {repr(found)[:_SHOWN]}"
    return ConfigError(where[:_WHERE], f"{first['msg']}{shown}", f"Correct this value.{tail}")


def place_in_file(path: Path | None, text: str, place: tuple[int | str, ...]) -> str:
    """File, line and key of a value, as errors name it."""
    where = f"{path}{_line(text, place)}: " if path is not None else ""
    return where + (".".join(map(str, place)) or "the whole file")


def _line(text: str, place: tuple[int | str, ...]) -> str:
    """Line of the key, searched inside its own section; of the section if the key is missing."""
    lines = text.splitlines()
    names = [key for key in place if isinstance(key, str)]
    index = next((key for key in place if isinstance(key, int)), 0)
    found, begin = 0, 0
    for depth in range(len(names), 0, -1):
        section = r"\s*\.\s*".join(re.escape(name) for name in names[:depth])
        headers = [
            number
            for number, line in enumerate(lines, 1)
            if re.match(rf"\s*\[+\s*{section}\s*\]+", line)
        ]
        if headers:
            begin = found = headers[min(index, len(headers) - 1)]
            names = names[depth:]
            break
    for number, line in enumerate(lines[begin:], begin + 1):
        if re.match(r"\s*\[+[\w\s.\"']+\]+\s*(#.*)?$", line):
            break
        if names and re.match(rf"\s*({re.escape(names[0])}\b)\s*[.=]", line):
            found = number
            break
    return f":{found}" if found else ""


def _known(model: type[BaseModel], place: tuple[int | str, ...]) -> list[str]:
    current: object = model
    for key in place:
        if isinstance(key, int):
            continue
        if isinstance(current, type) and issubclass(current, BaseModel):
            field = current.model_fields.get(key)
            current = None if field is None else field.annotation
            inner = getattr(current, "__args__", None)
            if inner:
                current = inner[0]
    if isinstance(current, type) and issubclass(current, BaseModel):
        return sorted(current.model_fields)
    return []
