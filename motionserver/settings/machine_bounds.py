"""What each value of a machine file may be by itself."""

from __future__ import annotations

from typing import Final, NamedTuple

from motionserver.settings.machine_file import MachineFile, Place


class Bound(NamedTuple):
    """What a value may be: ``low`` to ``high``, without the ends that are open."""

    unit: str
    low: float
    high: float
    open_low: bool = False
    open_high: bool = False

    def allows(self, value: float) -> bool:
        """Whether a value is inside."""
        above = value > self.low if self.open_low else value >= self.low
        return above and (value < self.high if self.open_high else value <= self.high)

    def __str__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        if self.open_high:
            low = "more than" if self.open_low else "at least"
            return f"allowed is {low} {self.low:g} and less than {self.high:g}{unit}"
        low = "more than 0, at most" if self.open_low else f"{self.low:g} to"
        return f"allowed is {low} {self.high:g}{unit}"


_LENGTH: Final = Bound("m", 0.0, 20.0, open_low=True)
_PLACE: Final = Bound("m", -20.0, 20.0)
_ANGLE: Final = Bound("deg", 0.0, 80.0, open_low=True, open_high=True)
BOUNDS: Final[dict[Place, Bound]] = {
    ("neutral_height",): _LENGTH,
    ("base_joints",): _PLACE,
    ("platform_joints",): _PLACE,
    ("head",): _PLACE,
    ("legs", "min"): _LENGTH,
    ("legs", "max"): _LENGTH,
    ("legs", "speed"): Bound("m/s", 0.0, 10.0, open_low=True),
    ("legs", "acceleration"): Bound("m/s2", 0.1, 150.0),
    ("legs", "jerk"): Bound("m/s3", 0.0, 1e5, open_low=True),
    ("workspace", "joint_angle_deg"): Bound("deg", 3.0, 90.0),
    ("workspace", "conditioning"): Bound("", 0.0, 1.0, open_low=True, open_high=True),
    ("workspace", "passenger_acceleration"): Bound("m/s2", 0.2, 150.0),
    ("workspace", "parked", "heave"): _PLACE,
    ("table2", "surge"): _LENGTH,
    ("table2", "sway"): _LENGTH,
    ("table2", "heave"): _LENGTH,
    ("table2", "roll_deg"): _ANGLE,
    ("table2", "pitch_deg"): _ANGLE,
    ("table2", "yaw_deg"): _ANGLE,
    ("pace", "speed"): Bound("m/s", 0.0, 10.0, open_low=True),
    ("pace", "acceleration"): Bound("m/s2", 0.0, 150.0, open_low=True),
    ("pace", "jerk"): Bound("m/s3", 0.0, 1e5, open_low=True),
}
"""Each key's unit and what its value alone may be; 150 m/s2 are some 15 g."""


def values_of(data: MachineFile, place: Place) -> list[tuple[Place, float]]:
    """Every number at a place, with its own place; none if it is left out."""
    value: object = data
    for key in place:
        value = None if value is None else getattr(value, str(key))
    found: list[tuple[Place, float]] = []
    _collect(place, value, found)
    return found


def _collect(place: Place, value: object, found: list[tuple[Place, float]]) -> None:
    if isinstance(value, tuple):
        for index, item in enumerate(value):
            _collect((*place, index), item, found)
    elif isinstance(value, int | float):
        found.append((place, float(value)))
