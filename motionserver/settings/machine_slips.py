"""The likely slip behind a machine that makes no sense: the one change that makes it right."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations
from math import degrees
from typing import Any, Final, NamedTuple

from pydantic import ValidationError

from motionserver.settings.machine_bounds import BOUNDS, values_of
from motionserver.settings.machine_file import Complaint, MachineFile, Place
from motionserver.settings.machine_sense import first_complaint

_G: Final = 9.80665
_UNITS: Final = {1e-3: "mm", 1e-2: "cm", 0.0254: "inch"}
"""Units people take for a metre, by their length [m]."""
_GROUPS: Final = {
    "all lengths": ("neutral_height", "base_joints", "platform_joints", "head", "legs", "parked",
                    "pace"),
    "all lengths, with those of [table2]": ("neutral_height", "base_joints", "platform_joints",
                                            "head", "legs", "parked", "pace", "table2"),
    "the geometry": ("neutral_height", "base_joints", "platform_joints", "head", "geometry",
                     "parked"),
    "the geometry but for [legs]": ("neutral_height", "base_joints", "platform_joints", "head",
                                    "parked"),
    "the joints": ("base_joints", "platform_joints"),
    "[legs] and [pace]": ("legs", "pace"),
    "the motion of [legs] and [pace]": ("motion", "pace"),
    "[legs]": ("legs",),
    "legs.min and legs.max": ("geometry",),
    "the motion of [legs]": ("motion",),
    "[pace]": ("pace",),
    "[table2]": ("table2",),
}  # fmt: skip
"""Keys that share a wrong unit, most at once first."""
_BOTH: Final = ("base_joints", "platform_joints")
_ROUNDS: Final = tuple(
    tuple((start + way * step) % 6 for step in range(6)) for way in (1, -1) for start in range(6)
)
"""Orders that begin at any corner and go round either way; the first changes nothing."""
_MOTION: Final = ("speed", "acceleration", "jerk")


class Slip(NamedTuple):
    """A change that makes the machine right.

    Attributes:
        place: The key to change; of several, the first.
        words: What it was, as a question.
        do: What to write instead.
    """

    place: Place
    words: str
    do: str


def likely_slip(data: MachineFile, complaint: Complaint, reach: Any = None) -> Slip | None:  # noqa: ANN401
    """Find the one change after which nothing is wrong any more.

    Args:
        data: The file that makes no sense.
        complaint: Why.
        reach: As for `machine_sense.complaints`.

    Returns:
        The slip; None if no single one explains it.
    """

    def is_right(changed: MachineFile | None) -> bool:
        return changed is not None and first_complaint(changed, reach) is None

    for slip, changed in _units(data, complaint):
        if is_right(changed):
            return slip
    for name, group in _GROUPS.items():
        places = [place for place in BOUNDS if _is_in(place, group)]
        units = [
            unit
            for factor, unit in _UNITS.items()
            if is_right(scaled(data, dict.fromkeys(places, factor)))
        ]
        if units:  # a small machine in mm may be a large one in cm
            words = f"{name} in {' or '.join(units)}?"
            return Slip(places[0], words, "Give them in m, m/s, m/s2, m/s3.")
    return next((slip for slip, changed in _joints(data) if is_right(changed)), None)


def _units(data: MachineFile, complaint: Complaint) -> Iterator[tuple[Slip, MachineFile | None]]:
    """One key in another unit, that of the complaint first."""
    keys = sorted(BOUNDS, key=lambda key: key != complaint.place[: len(key)])
    for place in (complaint.place, *keys):
        bound = BOUNDS[names_of(place)]
        values = [value for _, value in values_at(data, place)]
        if not any(values):
            continue
        for factor, words in _factors(bound.unit):
            alone = len(values) == 1
            do = f"Write {values[0] * factor:g}." if alone else f"Multiply by {factor:g}."
            yield Slip(place, words, do), scaled(data, {place: factor})


def _factors(unit: str) -> Iterator[tuple[float, str]]:
    if unit == "deg":
        yield degrees(1.0), "in rad?"
        yield 1e-3, "1000 times too large?"
        return
    if unit == "":
        yield 1e-2, "in percent?"
        yield 1e-3, "1000 times too large?"
        return
    if unit == "m/s2":
        yield _G, "in g?"
    for factor, length in _UNITS.items():
        yield factor, f"in {unit.replace('m', length, 1)}?"
    yield 1e3, "1000 times too small?"


def _is_in(place: Place, group: tuple[str, ...]) -> bool:
    if BOUNDS[place].unit in ("deg", "") or "passenger_acceleration" in place:
        return False
    if "geometry" in group and place in (("legs", "min"), ("legs", "max")):
        return True
    if "motion" in group and place[0] == "legs" and place[-1] in _MOTION:
        return True
    return place[0] in group or ("parked" in group and "parked" in place)


def names_of(place: Place) -> Place:
    """The key alone, without the number of a joint or coordinate."""
    return tuple(key for key in place if isinstance(key, str))


def values_at(data: MachineFile, place: Place) -> list[tuple[Place, float]]:
    """As `values_of`, for a place that may name one joint or coordinate."""
    found = values_of(data, names_of(place))
    return [(at, value) for at, value in found if at[: len(place)] == place]


def scaled(data: MachineFile, factors: dict[Place, float]) -> MachineFile | None:
    """The file with some values multiplied; None if a product is no number any more."""
    tree = data.model_dump()
    for place, factor in factors.items():
        for at, value in values_at(data, place):
            inner: Any = tree
            for key in at[:-1]:
                if isinstance(inner[key], tuple):
                    inner[key] = list(inner[key])
                inner = inner[key]
            inner[at[-1]] = value * factor
    try:
        return MachineFile.model_validate(tree)
    except ValidationError:  # a number so small or large that the product is none
        return None


def _joints(data: MachineFile) -> Iterator[tuple[Slip, MachineFile]]:
    """Joints in another order or along other axes; the whole machine counted otherwise last."""
    for key in _BOTH:
        name = key.removesuffix("_joints")
        for one, other in combinations(range(6), 2):
            order = tuple({one: other, other: one}.get(joint, joint) for joint in range(6))
            words = f"{name} joints {one + 1} and {other + 1} swapped?"
            yield (
                Slip((key,), words, "Exchange them (the first joint is number 1)."),
                _ordered(data, (key,), order),
            )
    for signs, axes in (((1, 1, -1), "z down"), ((1, -1, 1), "y to the right"),
                        ((-1, 1, 1), "x backwards"), ((-1, -1, 1), "x backwards, y to the right"),
                        ((1, -1, -1), "y to the right, z down")):  # fmt: skip
        for keys in (_BOTH, *((key,) for key in _BOTH)):
            name = " and ".join(keys)
            slip = Slip((keys[0],), f"{name} with {axes}?", "Give x forward, y left, z up.")
            yield slip, _turned(data, keys, signs)
    for key in _BOTH:
        for order in _ROUNDS[1:]:
            shown = ", ".join(str(joint + 1) for joint in order)
            slip = Slip((key,), f"{key} in another order?", f"Give its joints as {shown}.")
            yield slip, _ordered(data, (key,), order)


def _ordered(data: MachineFile, keys: tuple[str, ...], order: Sequence[int]) -> MachineFile:
    changed = {key: tuple(getattr(data, key)[joint] for joint in order) for key in keys}
    return data.model_copy(update=changed)


def _turned(data: MachineFile, keys: tuple[str, ...], signs: tuple[int, ...]) -> MachineFile:
    changed = {
        key: tuple(
            tuple(sign * value for sign, value in zip(signs, joint, strict=True))
            for joint in getattr(data, key)
        )
        for key in keys
    }
    return data.model_copy(update=changed)
