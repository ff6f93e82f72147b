"""One tunable as the page shows it: unit, meaning, effect of more of it, bounds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, get_args

from pydantic import Field
from pydantic.config import JsonDict
from pydantic.fields import FieldInfo

from motionserver.cueing.registry import algorithms as algorithms
from motionserver.errors import MotionServerError

Range = tuple[float, float]
"""Least and largest value."""

LONGEST_PATH: Final = 1024
"""Characters of a path."""


@dataclass(frozen=True, slots=True)
class FieldError:
    """Why one value cannot be taken.

    Attributes:
        field: Name of the tunable.
        value: What was asked for, as JSON can carry it.
        allowed: What would be accepted, in words.
        message: What is wrong.
    """

    field: str
    value: object
    allowed: str
    message: str

    def to_mapping(self) -> dict[str, object]:
        """Write it for JSON."""
        return {
            "field": self.field,
            "value": self.value,
            "allowed": self.allowed,
            "message": self.message,
        }


class TuningError(MotionServerError):
    """Values that cannot be taken; nothing was changed.

    Attributes:
        errors: One entry per bad field.
    """

    def __init__(self, errors: list[FieldError]) -> None:
        self.errors = errors
        super().__init__(
            "; ".join(f"{e.field} = {e.value!r}: {e.message}, allowed {e.allowed}" for e in errors)
        )


def number(
    default: float,
    low: float,
    high: float,
    unit: str,
    *,
    group: str,
    label: str,
    meaning: str,
    more: str,
) -> Any:  # noqa: ANN401  (what pydantic's Field itself returns)
    """Declare a bounded number.

    Args:
        default: Value of a fresh installation.
        low: Least value.
        high: Largest value whatever the machine.
        unit: Unit as shown, "" for a pure number.
        group: Heading it stands under.
        label: Short name on the page.
        meaning: One line that says what it is.
        more: What a larger value does.
    """
    extra: JsonDict = {"unit": unit, "group": group, "label": label, "more": more}
    return Field(
        default,
        ge=low,
        le=high,
        allow_inf_nan=False,
        description=f"{meaning} More = {more}.",
        json_schema_extra=extra,
    )


def choice(default: object, *, group: str, label: str, meaning: str) -> Any:  # noqa: ANN401  (as above)
    """Declare a word or a switch."""
    extra: JsonDict = {"unit": "", "group": group, "label": label, "more": ""}
    return Field(default, description=meaning, json_schema_extra=extra)


def file(default: str, *, group: str, label: str, meaning: str) -> Any:  # noqa: ANN401  (as above)
    """Declare the path of a file, which may be empty."""
    extra: JsonDict = {"unit": "", "group": group, "label": label, "more": "", "is_file": True}
    return Field(default, description=meaning, json_schema_extra=extra)


def shown(value: object) -> object:
    """A hostile value as JSON may carry it back: finite, short, harmless."""
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, int) and abs(value) < 2**53:
        return value
    if isinstance(value, float) and value - value == 0.0:
        return value
    return ascii(value)[:80] if not isinstance(value, int) else "a huge integer"


def bounds(item: FieldInfo, limit: Range | None) -> tuple[float, float, tuple[object, ...]]:
    """Least and largest value of a number (0, 0 for a word), and the choices of a word.

    Args:
        item: Declared by `number`, `choice` or `file`.
        limit: Range that the machine gives, if it has a say.
    """
    if _is_file(item):
        return 0.0, 0.0, ()
    if item.annotation is str:
        return 0.0, 0.0, algorithms()
    if item.annotation is bool:
        return 0.0, 0.0, (False, True)
    if item.annotation is not float:
        return 0.0, 0.0, get_args(item.annotation)
    low = next(float(m.ge) for m in item.metadata if hasattr(m, "ge"))
    high = next(float(m.le) for m in item.metadata if hasattr(m, "le"))
    return (low, high, ()) if limit is None else (*limit, ())


def allowed_range(item: FieldInfo, limit: Range | None) -> str:
    """What a tunable may be, in words."""
    if _is_file(item):
        return f"path of a file, at most {LONGEST_PATH} characters, or nothing"
    low, high, choices = bounds(item, limit)
    if choices:
        return " or ".join(str(c).lower() if isinstance(c, bool) else str(c) for c in choices)
    return f"{low:g} to {high:g} {_extra(item).get('unit', '')}".rstrip()


def described(
    name: str, item: FieldInfo, limits: dict[str, Range], users: tuple[str, ...]
) -> dict[str, object]:
    """One tunable for a page.

    Args:
        name: Its name.
        item: Declared by `number` or `choice`, or by a plug-in.
        limits: Ranges that the machine gives.
        users: Algorithms that read it.

    Returns:
        Name, default, meaning, unit, group, label, more, algorithms, and its range.
    """
    low, high, choices = bounds(item, limits.get(name))
    limited: dict[str, object] = (
        {"choices": list(choices)} if choices else {"min": low, "max": high}
    )
    if _is_file(item):
        limited = {}
    plain = {"unit": "", "group": users[0] if users else "", "label": name, "more": ""}
    about = {"name": name, "default": item.default, "meaning": item.description or ""}
    return about | plain | _extra(item) | {"algorithms": list(users)} | limited


def _is_file(item: FieldInfo) -> bool:
    return bool(_extra(item).get("is_file"))


def _extra(item: FieldInfo) -> dict[str, Any]:
    return item.json_schema_extra if isinstance(item.json_schema_extra, dict) else {}
