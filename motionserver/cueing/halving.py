"""Position limits that follow the real workspace (Thoendel 2014, equations 7 and 8)."""

from __future__ import annotations

from typing import Final, Protocol

import numpy as np

from motionserver.core.axes import Array
from motionserver.core.kinematics.hexapod import jacobian, leg_lengths
from motionserver.core.limits import Machine
from motionserver.core.state import PlatformState
from motionserver.errors import TunableError

STOP_RATE: Final = np.array([1.5, 1.5, 1.5, 1.0, 1.0, 1.0])
"""Deceleration assumed for a stopping distance [m/s2, rad/s2]."""
SHRINK_TIME: Final = 0.15
"""How fast "sound" limits close [s]."""
OPEN_TIME: Final = 1.5
"""How fast they open again [s]."""


class Halving(Protocol):
    """Keeps X_max, the position limits in force, (6,) [m, rad]; ``kind`` is its name."""

    kind: str
    x_max: Array

    def settle(self, poses: Array, start: PlatformState, box: Array, trouble: bool) -> None:
        """Adapt after one tick.

        Args:
            poses: Predicted poses, the last one the pose at rest, (N, 6).
            start: State at the hand-over.
            box: X_M, the outer limits, (6,).
            trouble: The governor had to cut the last plan, or the leg rows gave way.
        """
        ...


def make_halving(kind: str, machine: Machine, box: Array, period: float) -> Halving:
    """Make one by its name in the tuning.

    Raises:
        ValueError: There is none of that name.
    """
    if kind == "off":
        return Fixed(box)
    if kind == "paper":
        return PaperHalving(machine, box)
    if kind == "sound":
        return SoundHalving(machine, box, period)
    raise TunableError("halving", f"halving {kind!r} does not exist", "off, paper, sound")


class Fixed:
    """No adaptation: X_max = X_M."""

    kind = "off"

    def __init__(self, box: Array) -> None:
        self.x_max = np.array(box)

    def settle(self, poses: Array, start: PlatformState, box: Array, trouble: bool) -> None:
        """Follow the tunable box."""
        self.x_max = np.array(box)


class PaperHalving:
    """Equations 7 and 8, once per tick, on the last predicted pose.

    Repairs without which it has no meaning: |X| in place of X; only axes that drive the worst leg
    out shrink ("the affected direction"); never below where the platform is and must come to.
    """

    kind = "paper"

    def __init__(self, machine: Machine, box: Array) -> None:
        self._machine = machine
        self.x_max = np.array(box)

    def settle(self, poses: Array, start: PlatformState, box: Array, trouble: bool) -> None:
        """YES: X_max <- (X_max + X_M)/2 (7). NO: X_max <- (X_max + |X(k)|)/2 (8)."""
        last = poses[-1:]
        opened = 0.5 * (self.x_max + box)
        excess, row, leg, side = _worst(self._machine, last)
        if excess <= 0.0:
            self.x_max = opened
            return
        pull = _pull(self._machine, last[row], leg, side)
        halved = np.maximum(0.5 * (self.x_max + np.abs(last[0])), stopping_reach(start))
        self.x_max = np.minimum(np.where(pull > 0.0, halved, opened), box)


class SoundHalving:
    """X_max follows the exact reach of the whole predicted plan, without jumps.

    While the plan leaves the legs' stroke, or had to be cut, the axes that drive the worst leg
    close towards the share of the plan that fits; else all open again slowly.
    """

    kind = "sound"

    def __init__(self, machine: Machine, box: Array, period: float) -> None:
        self._machine = machine
        self._shrink = 1.0 - np.exp(-period / SHRINK_TIME)
        self._open = 1.0 - np.exp(-period / OPEN_TIME)
        self.x_max = np.array(box)

    def settle(self, poses: Array, start: PlatformState, box: Array, trouble: bool) -> None:
        """Close where a leg ends, open elsewhere; see the class."""
        excess, row, leg, side = _worst(self._machine, poses)
        if excess <= 0.0 and not trouble:
            self.x_max = self.x_max + self._open * (box - self.x_max)
            return
        pull = _pull(self._machine, poses[row], leg, side)
        reached = np.max(np.abs(poses), axis=0)
        share = 1.0 - min(0.5, max(excess, 0.002) / max(float(np.sum(np.maximum(pull, 0.0))), 0.02))
        goal = np.where(pull > 0.0, share * np.minimum(reached, self.x_max), self.x_max)
        goal = np.maximum(goal, np.minimum(stopping_reach(start), self.x_max))
        closed = self.x_max + self._shrink * (goal - self.x_max)
        self.x_max = np.minimum(np.minimum(closed, self.x_max), box)


def stopping_reach(start: PlatformState) -> Array:
    """|x| + v2 / 2a: how far the platform comes before it can stand, (6,) [m, rad]."""
    return np.abs(start.pose) + start.velocity**2 / (2.0 * STOP_RATE)


def _worst(machine: Machine, poses: Array) -> tuple[float, int, int, float]:
    """How far the worst leg is outside [m], in which pose, which leg, +1 too long, -1 too short."""
    lengths = leg_lengths(machine, poses)
    over, under = lengths - machine.leg_max, machine.leg_min - lengths
    beyond = np.maximum(over, under)
    row, leg = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
    side = 1.0 if over[row, leg] >= under[row, leg] else -1.0
    return float(beyond[row, leg]), int(row), int(leg), side


def _pull(machine: Machine, pose: Array, leg: int, side: float) -> Array:
    """Each axis' share in how far a leg is from neutral towards one end, (6,) [m]."""
    pull: Array = side * jacobian(machine, pose[None])[0, leg] * pose
    return pull
