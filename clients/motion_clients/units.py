"""Units that the header of a recording may name, by what a column holds."""

from __future__ import annotations

from math import pi
from typing import Final

STANDARD_GRAVITY: Final = 9.80665
"""What the unit g means [m/s^2]."""

_TIME: Final = {
    "s": 1.0, "sec": 1.0, "secs": 1.0, "second": 1.0, "seconds": 1.0,
    "ms": 1e-3, "msec": 1e-3, "millisecond": 1e-3, "milliseconds": 1e-3,
    "us": 1e-6, "usec": 1e-6, "microseconds": 1e-6, "ns": 1e-9, "nanoseconds": 1e-9,
    "min": 60.0, "minutes": 60.0,
}  # fmt: skip
_ACCELERATION: Final = {
    "m/s2": 1.0, "m/s/s": 1.0, "ms-2": 1.0, "m.s-2": 1.0, "mps2": 1.0, "m/sec2": 1.0,
    "g": STANDARD_GRAVITY, "gn": STANDARD_GRAVITY, "g0": STANDARD_GRAVITY,
    "mg": 1e-3 * STANDARD_GRAVITY, "cm/s2": 0.01, "mm/s2": 1e-3, "ft/s2": 0.3048,
}  # fmt: skip
_RATE: Final = {
    "rad/s": 1.0, "rads-1": 1.0, "rad.s-1": 1.0, "rad/sec": 1.0, "mrad/s": 1e-3, "1/s": 1.0,
    "deg/s": pi / 180.0, "deg/sec": pi / 180.0, "degs-1": pi / 180.0, "dps": pi / 180.0,
    "degrees/s": pi / 180.0,
}  # fmt: skip
_SPEED: Final = {
    "m/s": 1.0, "mps": 1.0, "ms-1": 1.0, "m.s-1": 1.0, "m/sec": 1.0,
    "km/h": 1.0 / 3.6, "kmh": 1.0 / 3.6, "kph": 1.0 / 3.6, "mph": 0.44704,
    "kn": 1852.0 / 3600.0, "kt": 1852.0 / 3600.0, "kts": 1852.0 / 3600.0, "ft/s": 0.3048,
}  # fmt: skip
_ANGLE: Final = {
    "rad": 1.0, "radian": 1.0, "radians": 1.0, "mrad": 1e-3,
    "deg": pi / 180.0, "degree": pi / 180.0, "degrees": pi / 180.0,
}  # fmt: skip
_OF_COLUMN: Final = {
    "t": _TIME, "v": _SPEED, "roll": _ANGLE, "pitch": _ANGLE, "steering": _ANGLE,
    **dict.fromkeys(("ax", "ay", "az", "fx", "fy", "fz"), _ACCELERATION),
    **dict.fromkeys(("p", "q", "r"), _RATE),
}  # fmt: skip
_SPELLINGS: Final = str.maketrans(
    {"²": "2", "⁻": "-", "¹": "1", "°": "deg", "·": ".", "⋅": ".", "*": ".", "µ": "u", "μ": "u",
     "\N{MINUS SIGN}": "-", " ": "", "^": ""}
)  # fmt: skip


def factor(column: str, unit: str) -> float | None:
    """What a value of this column in this unit is multiplied by to be SI; None if unknown."""
    known = _OF_COLUMN.get(column)
    return None if known is None else known.get(_plain(unit))


def known_units(column: str) -> str:
    """The commonest units of a column, for people."""
    return ", ".join(list(_OF_COLUMN.get(column, {}))[:14])


def _plain(unit: str) -> str:
    plain = unit.strip().replace("**", "^").translate(_SPELLINGS).lower()
    return plain.replace("s.-", "s-").replace("(", "").replace(")", "")
