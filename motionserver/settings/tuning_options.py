"""Tunables that only one plug-in has: found in its option model, checked by it, named after it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from motionserver.cueing.registry import algorithms, options_of
from motionserver.cueing.tuning import Option
from motionserver.errors import TunableError
from motionserver.settings.fields import FieldError, TuningError, allowed_range, bounds, shown


def option_models() -> dict[str, type[BaseModel]]:
    """The option model of every algorithm that has one; of a plug-in that is unusable, none."""
    found = {}
    for name in algorithms():
        try:
            check_options(name)
            model = options_of(name)
        except TunableError:
            continue
        if model is not None:
            found[name] = model
    return found


def check_options(algorithm: str) -> None:
    """Make sure that a page can show what a plug-in declares.

    Raises:
        TunableError: Its options are no pydantic model of bounded numbers, switches and words.
    """
    model = options_of(algorithm)
    if model is None:
        return
    allowed = "a pydantic model whose fields have a default and are float with ge and le, bool or"
    allowed += " Literal words"
    what = f"the options of cueing plug-in {algorithm!r} cannot be tuned"
    if not (isinstance(model, type) and issubclass(model, BaseModel)):
        raise TunableError("algorithm", what, allowed)
    for name, item in model.model_fields.items():
        try:
            low, high, choices = bounds(item, None)
        except (StopIteration, TypeError):
            raise TunableError("algorithm", f"{what}: {name} has no bounds", allowed) from None
        if item.is_required() or item.annotation is str or not (choices or low < high):
            raise TunableError("algorithm", f"{what}: {name}", allowed)


def option_fields() -> dict[str, tuple[str, str, FieldInfo]]:
    """All options by their name on the page: algorithm, name in its model, declaration."""
    return {
        f"{algorithm}_{name}": (algorithm, name, item)
        for algorithm, model in option_models().items()
        for name, item in model.model_fields.items()
    }


def default_options() -> dict[str, Option]:
    """The defaults, by their names on the page."""
    return {name: item.default for name, (_, _, item) in option_fields().items()}


def checked_options(values: Mapping[str, object]) -> dict[str, Option]:
    """Options that differ from their defaults, checked by the models of their plug-ins.

    Args:
        values: By their names on the page; all of them must exist.

    Raises:
        TuningError: A value is not allowed.
    """
    fields = option_fields()
    nested: dict[str, dict[str, object]] = {}
    for name, value in values.items():
        algorithm, inner, _ = fields[name]
        nested.setdefault(algorithm, {})[inner] = value
    errors, out = [], {}
    for algorithm, given in nested.items():
        model = option_models()[algorithm]
        try:
            taken = model.model_validate(given, strict=True)
        except ValidationError as error:
            errors += [_explained(algorithm, item) for item in error.errors(include_url=False)]
            continue
        for inner in given:
            value = getattr(taken, inner)
            if value != model.model_fields[inner].default:
                out[f"{algorithm}_{inner}"] = value
    if errors:
        raise TuningError(errors)
    return out


def nested_options(values: Mapping[str, Option]) -> dict[str, dict[str, Option]]:
    """All options by algorithm and by the name its plug-in gave, defaults filled in."""
    out: dict[str, dict[str, Option]] = {}
    for name, (algorithm, inner, item) in option_fields().items():
        out.setdefault(algorithm, {})[inner] = values.get(name, item.default)
    return out


def _explained(algorithm: str, item: Any) -> FieldError:  # noqa: ANN401  (pydantic's ErrorDetails)
    inner = str(item["loc"][0]) if item["loc"] else ""
    name = f"{algorithm}_{inner}"
    declared = option_fields().get(name)
    allowed = "" if declared is None else allowed_range(declared[2], None)
    return FieldError(name, shown(item["input"]), allowed, str(item["msg"]))
