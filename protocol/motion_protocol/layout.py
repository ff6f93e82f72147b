"""One table per packed record: field names and codes, from which packing and refusals follow."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from math import isfinite
from typing import Any

from .errors import FieldError, NotFiniteError


class Layout:
    """A packed little-endian record whose fields have names.

    Attributes:
        name: What the record is called in messages.
        size: Length on the wire [bytes].
        struct: The compiled layout.
    """

    __slots__ = ("_codes", "_floats", "_names", "name", "size", "struct")

    def __init__(self, name: str, fields: Sequence[tuple[str, str]]) -> None:
        """Compile the table.

        Args:
            name: What the record is called in messages.
            fields: Pairs of field name and `struct` code; an empty name is padding. The
                `f` fields must stand together, so that one sum tests them all.
        """
        self.name = name
        self.struct = struct.Struct("<" + "".join(code for _, code in fields))
        self.size = self.struct.size
        self._names = tuple(field for field, _ in fields if field)
        self._codes = tuple(code for field, code in fields if field)
        floats = [index for index, code in enumerate(self._codes) if code == "f"]
        self._floats = slice(floats[0], floats[-1] + 1) if floats else slice(0, 0)

    def pack(self, *values: bytes | float) -> bytes:
        """Write the fields in the order of the table.

        Raises:
            NotFiniteError: A float is NaN or infinite.
            FieldError: A value has the wrong type or does not fit its field.
        """
        try:
            data = self.struct.pack(*values)
        except (struct.error, OverflowError):
            raise self._misfit(values) from None
        self._check_finite(values)
        return data

    def unpack(self, data: bytes, offset: int) -> tuple[Any, ...]:
        """Read the fields at an offset.

        Raises:
            NotFiniteError: A float is NaN or infinite.
        """
        values = self.struct.unpack_from(data, offset)
        self._check_finite(values)
        return values

    def _check_finite(self, values: tuple[Any, ...]) -> None:
        # A sum is finite exactly when all its terms are: f32 terms cannot overflow a double.
        if isfinite(sum(values[self._floats])):
            return
        name, value = next(
            (name, value)
            for name, value in zip(self._names[self._floats], values[self._floats], strict=True)
            if not isfinite(value)
        )
        raise not_finite(f"{self.name}.{name}", value)

    def _misfit(self, values: tuple[Any, ...]) -> FieldError:
        name, code, value = next(
            (name, code, value)
            for name, code, value in zip(self._names, self._codes, values, strict=True)
            if not _fits(code, value)
        )
        field = f"{self.name}.{name}"
        return FieldError(
            f"{field} = {value!r} does not fit its field of type {code!r} on the wire; "
            f"send a value of the type and width given in the byte tables",
            field=field,
        )


def _fits(code: str, value: bytes | float) -> bool:
    try:
        struct.pack("<" + code, value)
    except (struct.error, OverflowError):
        return False
    return True


def not_finite(field: str, value: float) -> NotFiniteError:
    """Word the refusal of a NaN or an infinity."""
    return NotFiniteError(
        f"{field} is {value}, but every number on the wire must be finite; "
        f"send 0 and clear the field's valid bit where the value is not known",
        field=field,
    )
