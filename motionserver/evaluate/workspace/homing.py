"""Random poses of a box: how many are reachable, and how many of those lack a straight way home."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from motionserver.core.axes import Array, Axis, Bools, frozen
from motionserver.core.kinematics.hexapod import leg_lengths
from motionserver.core.kinematics.reach import posture_allowed, reachable
from motionserver.core.limits import Machine

FACTORS: Final = (1.0, 0.5, 0.3)
"""Sizes of the box, as shares of the whole."""
_POSES: Final = (50000, 4000, 2000)
"""How many are drawn of each: of a large box few are reachable."""
_TRIED: Final = 1500
_ALONG: Final = np.linspace(0.0, 1.0, 65)[:, None]
_POSTURE_EVERY: Final = 4
_HIGHER: Final = (0.85, 0.7, 0.5, 0.3)
"""Parked heights that are tried instead, as shares of the machine's."""
FEW: Final = 0.02
"""Share of poses without a way home that is called few."""


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
    for factor, count in zip(FACTORS, _POSES, strict=True):
        share, reached = _drawn(machine, factor * box, count)
        lost = stranded(machine, reached)
        out.append(Share(factor, share, float(np.mean(lost)) if len(lost) else 0.0, len(lost)))
    return tuple(out)


def _drawn(machine: Machine, box: Array, count: int) -> tuple[float, Array]:
    """Share of ``count`` random poses of a box that is reachable; and those poses, or enough."""
    poses = np.random.default_rng(2).uniform(-1.0, 1.0, (count, 6)) * box
    good = reachable(machine, poses)
    return float(good.mean()), poses[good][:_TRIED]


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


def park_higher(machine: Machine, box: Array) -> tuple[float, float] | None:
    """Find the lowest parked heave nearer to neutral that leaves few poses without a way home.

    Returns:
        That heave [m] and the share of the reachable poses of the whole box that are left
        without a way home; None if no height helps.
    """
    _, poses = _drawn(machine, box, _POSES[0])
    for share in _HIGHER if len(poses) else ():
        parked = machine.parked_pose * share
        parked[Axis.HEAVE] = round(float(parked[Axis.HEAVE]), 3)
        lost = stranded(replace(machine, parked_pose=frozen(parked)), poses)
        if float(lost.mean()) <= FEW:
            return float(parked[Axis.HEAVE]), float(lost.mean())
    return None
