"""How poses, axes and directions are said to people: metres, degrees, forwards, nose down."""

from __future__ import annotations

from math import degrees
from typing import Final

from motionserver.core.axes import AXIS_NAMES
from motionserver.evaluate.workspace.result import Corner, Range

TOWARDS: Final = (
    ("backwards", "forwards"),
    ("to the right", "to the left"),
    ("down", "up"),
    ("left side down", "right side down"),
    ("nose up", "nose down"),
    ("turned right", "turned left"),
)
"""Words for the negative and the positive direction of each axis (ISO 8855)."""
LOPSIDED: Final = 1.1
"""Ratio of the two ends from which a range is called lopsided."""


def amount(axis: int, value: float, signed: bool = True) -> str:
    """A coordinate with its unit: ``+0.198 m`` or ``-19.85 deg``."""
    sign = "+" if signed else ""
    if axis < 3:
        return f"{value:{sign}.3f} m"
    return f"{degrees(value):{sign}.2f} deg"


def corner_of(axes: tuple[int, int], corner: Corner) -> str:
    """A corner of a plane: ``backwards, nose down``."""
    return ", ".join(TOWARDS[axis][sign > 0] for axis, sign in zip(axes, corner.signs, strict=True))


def pose_text(pose: tuple[float, ...]) -> str:
    """A pose, what is neutral left out."""
    parts = [
        f"{AXIS_NAMES[axis]} {amount(axis, value)}"
        for axis, value in enumerate(pose)
        if abs(value) > 5e-4
    ]
    return ", ".join(parts) or "neutral"


def lopsided(one: Range) -> str | None:
    """Say in one sentence how a range is not symmetric; None if it nearly is."""
    low, high = abs(one.low), abs(one.high)
    if max(low, high) < LOPSIDED * min(low, high):
        return None
    near, far = (0, 1) if low < high else (1, 0)
    ends, why = (one.low, one.high), (one.low_end, one.high_end)
    return (
        f"{one.name} reaches {amount(one.axis, ends[far])} {TOWARDS[one.axis][far]} but "
        f"{amount(one.axis, ends[near])} {TOWARDS[one.axis][near]}: {why[near]}"
    )
