"""What the joints themselves tell: which base joint belongs to which leg, and how legs are counted.

Leg 1 is at the front left, the others follow counter-clockwise seen from above (x forward, y left),
and the two joints of a leg are neighbours. Only directions count here, so that no unit matters.
"""

from __future__ import annotations

from itertools import permutations
from typing import Final

import numpy as np

from motionserver.core.axes import Array, Bools
from motionserver.settings.machine_file import Complaint, MachineFile

AHEAD: Final = np.radians(5.0)
"""How far right of straight ahead leg 1 may still be."""
FARTHEST: Final = np.radians(90.0)
"""Widest angle between the two joints of a leg, seen from above."""
_BETTER: Final = 0.02
"""By how much another assignment of joints must be closer to be taken for the right one."""
_LEAST: Final = 1e-3
_TOGETHER: Final = np.radians(1.0)
"""Legs closer than this may come in any order."""
_ASSIGNMENTS: Final = np.array(list(permutations(range(6))))


def azimuths(joints: Array) -> Array:
    """Directions of the joints (6, 3) from their centre, seen from above, (6,) [rad]."""
    seen = joints[:, :2] - joints[:, :2].mean(0)
    return np.asarray(np.arctan2(seen[:, 1], seen[:, 0]), dtype=np.float64)


def order_complaint(data: MachineFile) -> Complaint | None:
    """Why the joints cannot be those of legs 1 to 6 in this order; None if they can."""
    base, platform = (azimuths(np.array(j)) for j in (data.base_joints, data.platform_joints))
    apart = 1.0 - np.cos(base[:, None] - platform)
    costs = apart[_ASSIGNMENTS, np.arange(6)].sum(1)
    own, best = float(np.trace(apart)), int(np.argmin(costs))
    if own > (1.0 + _BETTER) * float(costs[best]) + _LEAST:
        wrong = [leg + 1 for leg in range(6) if _ASSIGNMENTS[best][leg] != leg]
        return Complaint(
            ("base_joints",),
            f"base and platform joints of legs {_list(wrong)} are not neighbours: the legs would "
            "cross",
            "Leg i joins base joint i and platform joint i; the base joints nearest to platform "
            f"joints 1 to 6 are {_list([int(i) + 1 for i in _ASSIGNMENTS[best]])}.",
        )
    far = np.flatnonzero(np.cos(base - platform) < np.cos(FARTHEST))
    if len(far):
        leg = int(far[0])
        angle = np.degrees(np.arccos(np.cos(base[leg] - platform[leg])))
        return Complaint(
            ("platform_joints", leg),
            f"platform joint {leg + 1} is {angle:.0f} deg from base joint {leg + 1} seen from "
            f"above, allowed {np.degrees(FARTHEST):.0f} deg",
            "Check that both are given with x forward and y left.",
        )
    return _counting(base, platform)


def _counting(base: Array, platform: Array) -> Complaint | None:
    legs = np.arctan2(np.sin(base) + np.sin(platform), np.cos(base) + np.cos(platform))
    if bool(_is_counted_right(legs)):
        return None
    turn = np.mod(legs + AHEAD, 2.0 * np.pi)
    right = [int(leg) + 1 for leg in np.argsort(turn, kind="stable")]
    if bool(_is_counted_right(-legs[::-1])) or bool(_is_ascending(-legs)):
        found = f"the joints tell that the legs are counted clockwise, leg 1 at {_side(legs[0])}"
    elif bool(_is_ascending(legs)):
        found = f"the joints tell that leg 1 is at {_side(legs[0])}"
    else:
        found = "the joints tell that the legs do not follow each other round the platform"
    return Complaint(
        ("base_joints",),
        f"{found}; leg 1 must be the one at the front left (x forward, y left), the others "
        "counter-clockwise seen from above",
        "Legs in another order? Give base_joints and platform_joints in the order "
        f"{_list(right)}; where the base's actuators follow the old order, [platform] leg_order "
        "in the configuration then is "
        f"{[right.index(leg) for leg in range(1, 7)]}.",
        is_open=True,
    )


def _is_counted_right(legs: Array) -> Bools:
    first = np.mod(legs[0] + AHEAD, 2.0 * np.pi)
    others = np.mod(legs + AHEAD, 2.0 * np.pi)
    right: Bools = np.asarray(_is_ascending(legs) & (first <= others.min() + _TOGETHER))
    return right


def _is_ascending(legs: Array) -> Bools:
    steps = np.mod(np.diff(legs, append=legs[0]) + _TOGETHER, 2.0 * np.pi) - _TOGETHER
    ascending: Bools = np.asarray(np.isclose(steps.sum(), 2.0 * np.pi) & (steps < np.pi).all())
    return ascending


def _side(angle: float) -> str:
    degrees = float(np.degrees(angle))
    if abs(degrees) < np.degrees(AHEAD) or abs(degrees) > 180.0 - np.degrees(AHEAD):
        return "the front" if abs(degrees) < 90.0 else "the rear"
    end = "front" if abs(degrees) < 85.0 else "middle" if abs(degrees) < 95.0 else "rear"
    return f"the {end} {'left' if degrees > 0.0 else 'right'} ({degrees:.0f} deg)"


def _list(numbers: list[int]) -> str:
    return ", ".join(map(str, numbers))
