"""Whether the values of a machine file make sense, each alone and all together."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from motionserver.core.axes import AXIS_NAMES, Array
from motionserver.core.kinematics.hexapod import leg_directions, leg_lengths, neutral_conditioning
from motionserver.core.limits import Machine
from motionserver.core.motion.moves import straight_way
from motionserver.core.safety.verify import GUARD_MARGINS, LONGEST_MOVE, check_ways_home
from motionserver.settings.joint_order import order_complaint
from motionserver.settings.machine_bounds import BOUNDS, values_of
from motionserver.settings.machine_file import Complaint, MachineFile
from motionserver.settings.machine_motion import leg_complaints, pace_complaints

RADIUS: Final = (0.01, 8.0)
"""Mean distance of joints from their centre, from a hexapod on a desk to one in a hall [m]."""
_RADII: Final = 10.0
"""Most times that one circle of joints is as large as the other."""
_STROKE_SHARE: Final = 4.0
"""Longest leg as a multiple of the shortest: a simple actuator does not reach 2."""
_SIGMA: Final = 0.03
"""Least smallest singular value at neutral; usual machines have 0.5 to 1.2."""
_FREE: Final = 0.2
"""Share of the free motion from which on an axis is named."""
_HEAD: Final = (3.0, 2.0)
"""Farthest head: so many metres, and so many radii of the platform joints."""
_BOX_TIMES: Final = 20.0
"""Times what the machine reaches from which on a box is a slip, and no wish."""


def farthest_head(platform_joints: Array) -> float:
    """How far from the reference point a driver's head may be [m]."""
    seen = platform_joints[:, :2] - platform_joints[:, :2].mean(0)
    return _HEAD[0] + _HEAD[1] * float(np.hypot(*seen.T).mean())


def complaints(data: MachineFile, reach: Array | None = None) -> Iterator[Complaint]:
    """Everything that is wrong, the most telling first; each relies on those before.

    Args:
        data: The file.
        reach: What each axis reaches alone, (6,) [m, rad], to judge the box; None: not judged.
    """
    yield from _bounds(data)
    yield from _sizes(data)
    order = order_complaint(data)
    if order is not None:
        yield order
    machine = data.to_machine(np.ones(6))
    yield from _singular(machine)
    yield from _ways(data, machine)
    yield from leg_complaints(data)
    yield from pace_complaints(data)
    if data.table2 is not None and reach is not None:
        yield from _box(data.table2.to_si(), reach)


def first_complaint(data: MachineFile, reach: Array | None = None) -> Complaint | None:
    """The most telling of `complaints`; None if the machine makes sense."""
    return next(complaints(data, reach), None)


def _bounds(data: MachineFile) -> Iterator[Complaint]:
    legs = data.legs
    if legs.min >= legs.max:
        yield Complaint(
            ("legs", "min"),
            f"{legs.min:g} m is not shorter than legs.max = {legs.max:g} m",
            "Give the two ends of the stroke.",
        )
    for key, bound in BOUNDS.items():
        for place, value in values_of(data, key):
            if not bound.allows(value):
                yield Complaint(place, f"{value:g}: {bound}", "Correct this value.")


def _sizes(data: MachineFile) -> Iterator[Complaint]:
    legs = data.legs
    if legs.max > _STROKE_SHARE * legs.min:
        yield Complaint(
            ("legs", "max"),
            f"{legs.max:g} m is {legs.max / legs.min:.3g} times legs.min, allowed is "
            f"{_STROKE_SHARE:g} times: legs are measured from pin to pin",
            "Give the two ends of the stroke.",
        )
    radii = {}
    for key in ("base_joints", "platform_joints"):
        joints = np.array(getattr(data, key))[:, :2]
        radii[key] = radius = float(np.hypot(*(joints - joints.mean(0)).T).mean())
        if not RADIUS[0] <= radius <= RADIUS[1]:
            singular = "; joints at one place make it singular" if radius < RADIUS[0] else ""
            yield Complaint(
                (key,),
                f"the joints are {radius:.3g} m from their centre, allowed is {RADIUS[0]:g} to "
                f"{RADIUS[1]:g} m{singular}",
                "Give all coordinates in m.",
            )
    small, large = sorted(radii, key=lambda key: radii[key])
    if radii[large] > _RADII * radii[small]:
        yield Complaint(
            (large,),
            f"the joints are {radii[large]:.3g} m from their centre, those of {small} "
            f"{radii[small]:.3g} m: allowed is {_RADII:g} times",
            "Give all coordinates in m.",
        )
    far, most = float(np.linalg.norm(data.head)), farthest_head(np.array(data.platform_joints))
    if far > most:
        yield Complaint(
            ("head",),
            f"the head is {far:.3g} m from the reference point, allowed is {most:.3g} m",
            "Give it from the motion reference point, in m.",
        )


def _singular(machine: Machine) -> Iterator[Complaint]:
    sigma = neutral_conditioning(machine)
    if sigma >= _SIGMA:
        return
    seen = leg_directions(machine, np.zeros((1, 6)))
    rows = np.concatenate((seen.unit[0], np.cross(seen.arms[0], seen.unit[0])), axis=1)
    radius = float(np.hypot(*machine.platform_joints[:, :2].T).mean())
    rows[:, 3:] /= max(radius, 1e-9)
    free = np.abs(np.linalg.svd(rows)[2][-1])
    shares = zip(AXIS_NAMES, free / free.max(), strict=True)
    axes = [name for name, share in shares if share > _FREE]
    yield Complaint(
        ("platform_joints",),
        f"the hexapod is singular at neutral (smallest singular value {sigma:.2g}, allowed "
        f"{_SIGMA:g}): with all legs locked it still moves in {' and '.join(axes)}",
        "Turn one of the two hexagons by 60 deg, so that each pair of base joints stands between "
        "two pairs of platform joints. Or check the joints' order: leg i joins base joint i and "
        "platform joint i.",
    )


def _ways(data: MachineFile, machine: Machine) -> Iterator[Complaint]:
    low, high = data.legs.min, data.legs.max
    for place, pose, name in (
        (("neutral_height",), np.zeros(6), "neutral"),
        (("workspace", "parked", "heave"), machine.parked_pose, "the parked pose"),
    ):
        legs = leg_lengths(machine, pose)
        if legs.min() < low or legs.max() > high:
            yield Complaint(
                place,
                f"at {name} the legs would be {legs.min():.4g} to {legs.max():.4g} m long, "
                f"allowed is {low:g} to {high:g} m: no allowed straight way begins or ends there",
                "Check neutral_height, the joints, legs.min, legs.max and workspace.parked.",
            )
    homes = np.stack((np.zeros(6), machine.parked_pose))
    slowest = straight_way(machine, np.zeros(6), machine.parked_pose).duration
    if slowest > LONGEST_MOVE:
        yield Complaint(
            ("pace", "speed"),
            f"with [pace] as it is, no allowed straight way leads between neutral and the parked "
            f"pose: it would take {slowest:.3g} s, allowed is {LONGEST_MOVE:g} s",
            "Give [pace] a larger speed, acceleration and jerk.",
        )
    for start in homes:
        rejection = check_ways_home(machine, start, homes, GUARD_MARGINS)
        if rejection is not None:
            yield Complaint(
                ("workspace", "parked", "heave"),
                f"no allowed straight way between neutral and the parked pose ({rejection})",
                "Check neutral_height, the joints, legs.min, legs.max, workspace.parked.",
            )


def _box(box: Array, reach: Array) -> Iterator[Complaint]:
    for key, value, own in zip(list(BOUNDS)[-9:-3], box.tolist(), reach.tolist(), strict=True):
        if value > _BOX_TIMES * own:
            angle = str(key[1]).endswith("_deg")
            shown = (np.degrees(value), np.degrees(own), "deg") if angle else (value, own, "m")
            yield Complaint(
                key,
                f"{shown[0]:g} {shown[2]}, and the machine reaches {shown[1]:.3g} {shown[2]}",
                "Give what the axis reaches alone, or leave [table2] out: it is then computed.",
            )
