"""What every section of the configuration is made of: declared keys, paths, ports, addresses."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    ValidationInfo,
    field_validator,
)


def _usable(value: str) -> str:
    if "\0" in value:
        raise ValueError("a path cannot hold the character NUL")
    try:
        Path(value).expanduser()
    except RuntimeError:
        raise ValueError("no user of the name behind ~ exists; give the whole path") from None
    return value


FilePath = Annotated[str, AfterValidator(_usable)]
Port = Annotated[int, Field(ge=1, le=65535)]
AnyPort = Annotated[int, Field(ge=0, le=65535)]
Arm = Annotated[float, Field(allow_inf_nan=False, ge=-10.0, le=10.0)]
EMPTY: Final = "empty"
"""Key of a field's extra: what its default means, where the value alone does not say it."""
EXAMPLE: Final = "example"
"""Key of a field's extra: a value to show of a key that has no default."""


def key(default: object, about: str, *, empty: str = "", example: object = None) -> Any:  # noqa: ANN401  (what pydantic's Field itself returns)
    """Declare a key.

    Args:
        default: Its value when it is not given.
        about: What it means, with its unit; bounds and default are added where it is shown.
        empty: What the default means, if the value alone does not say it.
        example: A value to show, if the default cannot be written in TOML.
    """
    extra: dict[str, Any] = {EMPTY: empty, EXAMPLE: example}
    return Field(default, description=about, json_schema_extra=extra)


class Strict(BaseModel):
    """A section: unknown keys are refused."""

    model_config = ConfigDict(extra="forbid")

    @field_validator("*", mode="before")
    @classmethod
    def _no_switch(cls, value: object, info: ValidationInfo) -> object:
        """Refuse ``true`` where a number is meant: it would be taken for 1."""
        field = cls.model_fields[str(info.field_name)]
        if isinstance(value, bool) and field.annotation is not bool:
            raise ValueError("true and false are no numbers; write the number")
        return value


def split_address(text: str) -> tuple[str, int]:
    """Split "host:port".

    Raises:
        ValueError: It is not host:port, or the port is not 0..65535.
    """
    host, _, port = text.rpartition(":")
    digits = port.isascii() and port.isdigit() and len(port) <= 5
    if not host or not digits or int(port) > 65535:
        raise ValueError(f"{text[:60]!r} is not HOST:PORT, for example 127.0.0.1:4600")
    return host.strip("[]"), int(port)
