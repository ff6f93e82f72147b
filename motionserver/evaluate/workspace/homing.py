"""Random poses of a box: how many are reachable, and how many of those lack a straight way home."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from motionserver.core.axes import Array
from motionserver.core.kinematics.hexapod import leg_lengths
from motionserver.core.limits import Machine
from motionserver.evaluate.workspace.reach import Bools, posture_allowed, reachable

FACTORS: Final = (1.0, 0.5, 0.3)
"""Sizes of the box, as shares of the whole."""
_POSES: Final = 20000
_TRIED: Final = 1500
_ALONG: Final = np.linspace(0.0, 1.0, 65)[:, None]
_POSTURE_EVERY: Final = 4


@dataclass(frozen=True, slots=True)
class Share:
    """Random poses of a box of one size.

    Attributes:
        factor: Size as a share of the whole box.
        reachable: Share of the poses that is reachable.
        stranded: Share of the reachable ones without an allowed straight way to neutral or to the
            parked pose; the guard refuses plans that end there.
        tried: How many ways home were tried; 0 if no pose was reachable.
    """

    factor: float
    reachable: float
    stranded: float
    tried: int


def shares(machine: Machine, box: Array) -> tuple[Share, ...]:
    """Draw poses evenly from the box (6,) at each of its `FACTORS`; always the same ones."""
    out = []
    unit = np.random.default_rng(2).uniform(-1.0, 1.0, (_POSES, 6))
    for factor in FACTORS:
        # the smallest box is reachable nearly throughout: fewer poses tell as much
        poses = unit[: int(_POSES * max(factor, 0.3) ** 2)] * (factor * box)
        good = reachable(machine, poses)
        reached = poses[good][:_TRIED]
        lost = stranded(machine, reached) if len(reached) else np.zeros(0, dtype=bool)
        share = float(lost.mean()) if len(lost) else 0.0
        out.append(Share(factor, float(good.mean()), share, len(reached)))
    return tuple(out)


def stranded(machine: Machine, poses: Array) -> Bools:
    """Which of the reachable poses (N, 6) have no straight way to neutral and to parked: (N,)."""
    lost: Bools = np.zeros(len(poses), dtype=bool)
    for home in (np.zeros(6), machine.parked_pose):
        rows = np.flatnonzero(~lost)
        ways = poses[rows, None] + _ALONG * (home - poses[rows])[:, None]
        legs = leg_lengths(machine, ways.reshape(-1, 6)).reshape(len(rows), -1)
        kept = (legs.min(1) >= machine.leg_min) & (legs.max(1) <= machine.leg_max)
        coarse = ways[kept][:, ::_POSTURE_EVERY]
        posture = posture_allowed(machine, coarse.reshape(-1, 6)).reshape(len(coarse), -1)
        kept[kept] = posture.all(1)
        lost[rows] = ~kept
    return lost
