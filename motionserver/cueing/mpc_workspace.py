"""Rows beyond the legs: tuned position limits, joint angles, conditioning, passenger's limit.

They matter at few instants, so each has a few rows only, given anew every period to the nodes that
are nearest to the limit. All share the legs' slack. A joint's swing is the length of a vector, so
its row tells little while the swing is small: below about 20 deg the governor does the work.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Final

import numpy as np

from motionserver.core.axes import AXIS_NAMES, Array, Axis
from motionserver.core.kinematics.hexapod import (
    conditioning,
    is_conditioned,
    joint_angles,
    neutral_conditioning,
)
from motionserver.core.limits import Machine
from motionserver.cueing.mpc_grid import SplineGrid
from motionserver.cueing.mpc_nominal import Nominal

FIRST_LOOK: Final = 0.1
"""From when on tuned position limits are looked at [s]."""
TUNED: Final = 0.999
"""A position limit below this share of the machine's own counts as tuned."""
JOINT_LOOKS: Final = 3
"""Nodes at which each of the twelve joints is looked at."""
CONDITION_LOOKS: Final = 3
PASSENGER_LOOKS: Final = 6
JOINT_NEAR: Final = 0.85
"""Share of the largest joint angle from which on rows are worth their computing."""
CONDITION_NEAR: Final = 1.6
"""Multiple of the least conditioning up to which they are."""
CONDITION_KEPT: Final = 1.15
"""Multiple of the least conditioning that a new plan keeps: it is far from linear."""
LOOK_EVERY: Final = 4
"""Periods from one look at a distant limit to the next."""
KEPT: Final = 0.97
"""Share of a limit that a new plan may use."""
_STEP: Final = 1e-5

Put = Callable[[slice, Array, Array, Array], None]
"""Rows, gradients by the six axes (n, 6), gains of the coefficients (n, K), bounds (n,)."""


class WorkspaceRows:
    """The few rows with changing nodes.

    Args:
        machine: Geometry and limits.
        grid: The grid of plans.
        box: Tuned position limits, (6,) [m, rad].
        first: Number of their first row.
    """

    def __init__(self, machine: Machine, grid: SplineGrid, box: Array, first: int) -> None:
        self._machine, self._grid = machine, grid
        self.axes = tuned_axes(machine, box)
        self._looks = np.flatnonzero(grid.nodes > FIRST_LOOK)
        self._coarse = grid.knots[
            np.unique(np.linspace(grid.pieces // 3, grid.pieces - 1, 8).astype(int))
        ]
        counts = (
            len(self.axes) * len(self._looks),
            12 * JOINT_LOOKS if machine.joint_angle is not None else 0,
            CONDITION_LOOKS if machine.conditioning is not None else 0,
            PASSENGER_LOOKS if machine.passenger_acceleration is not None else 0,
        )
        ends = first + np.cumsum((0, *counts))
        self.box, self.joint, self.condition, self.passenger = (
            slice(int(a), int(b)) for a, b in pairwise(ends)
        )
        self.end = int(ends[-1])
        # nothing is known yet: look at all of them at once
        self._near = {0, 1, 2}
        self._turn = 0

    def blocks(self) -> dict[str, slice]:
        """Rows of each limit by its name; box rows axis by axis."""
        looks, first = len(self._looks), self.box.start
        axes = {
            AXIS_NAMES[axis]: slice(first + n * looks, first + (n + 1) * looks)
            for n, axis in enumerate(self.axes)
        }
        return {
            **axes,
            "joint angle": self.joint,
            "conditioning": self.condition,
            "passenger": self.passenger,
        }

    def fill(self, nominal: Nominal, box: Array, put: Put, leave: Callable[[slice], None]) -> None:
        """Write the rows with ``put``, or ``leave`` those that are far from mattering.

        Args:
            nominal: The motion at the nodes.
            box: Tuned position limits, (6,) [m, rad].
            put: Writes rows.
            leave: Makes rows say nothing.
        """
        self._fill_box(nominal.pose, box, put)
        self._turn += 1
        for kind, (rows, fill) in enumerate(
            (
                (self.joint, self._fill_joints),
                (self.condition, self._fill_conditioning),
                (self.passenger, self._fill_passenger),
            )
        ):
            due = kind in self._near or (self._turn + kind) % LOOK_EVERY == 0
            if rows.stop == rows.start or not due:
                continue
            if fill(nominal, put):
                self._near.add(kind)
            else:
                self._near.discard(kind)
                leave(rows)

    def _fill_box(self, pose: Array, box: Array, put: Put) -> None:
        nodes = np.tile(self._looks, len(self.axes))
        axes = np.repeat(np.array(self.axes, dtype=int), len(self._looks))
        value = pose[nodes, axes] / box[axes]
        side = np.where(value >= 0.0, 1.0, -1.0)
        gradient = np.zeros((len(nodes), 6))
        gradient[np.arange(len(nodes)), axes] = side / box[axes]
        kept = np.where(box[axes] < TUNED * self._machine.box[axes], KEPT, 1.0)
        put(self.box, gradient, self._grid.at_nodes.pose[nodes], kept - side * value)

    def _fill_joints(self, nominal: Nominal, put: Put) -> bool:
        machine, limit = self._machine, self._machine.joint_angle
        assert limit is not None
        nodes = self._coarse
        swing = joint_angles(machine, nominal.pose[nodes]).reshape(len(nodes), 12) / limit
        if swing.max() < JOINT_NEAR:
            return False
        rows = np.argsort(swing, axis=0)[-JOINT_LOOKS:].ravel()
        joints = np.tile(np.arange(12), JOINT_LOOKS)
        poses = nominal.pose[nodes[rows]]
        moved = joint_angles(machine, _nudged(poses)).reshape(len(rows), 6, 12) / limit
        found = np.take_along_axis(moved, joints[:, None, None], axis=2)[..., 0]
        value = swing[rows, joints]
        gradient = (found - value[:, None]) / _STEP
        put(self.joint, gradient, self._grid.at_nodes.pose[nodes[rows]], KEPT - value)
        return True

    def _fill_conditioning(self, nominal: Nominal, put: Put) -> bool:
        machine, share = self._machine, self._machine.conditioning
        assert share is not None
        least = share * neutral_conditioning(machine)
        nodes = self._coarse
        if is_conditioned(machine, nominal.pose[nodes], CONDITION_NEAR * least):
            return False
        values = conditioning(machine, nominal.pose[nodes]) / least
        rows = np.argsort(values)[:CONDITION_LOOKS]
        poses = nominal.pose[nodes[rows]]
        moved = conditioning(machine, _nudged(poses)).reshape(len(rows), 6) / least
        gradient = -(moved - values[rows, None]) / _STEP
        room = values[rows] - CONDITION_KEPT
        put(self.condition, gradient, self._grid.at_nodes.pose[nodes[rows]], room)
        return True

    def _fill_passenger(self, nominal: Nominal, put: Put) -> bool:
        limit = self._machine.passenger_acceleration
        assert limit is not None
        felt = nominal.acceleration[:, :3] / limit
        size = np.linalg.norm(felt, axis=1)
        nodes = np.argsort(size)[-PASSENGER_LOOKS:]
        gradient = np.zeros((len(nodes), 6))
        gradient[:, :3] = felt[nodes] / np.maximum(size[nodes, None], 1e-6) / limit
        gains = self._grid.at_nodes.acceleration[nodes]
        put(self.passenger, gradient, gains, KEPT - size[nodes])
        return True


def tuned_axes(machine: Machine, box: Array) -> tuple[int, ...]:
    """Axes whose position limit has rows: all angles, and translations tuned below the machine's.

    The machine's own box holds for single axes; combined, the legs decide on translations. Angles
    beyond it lead to where joints and conditioning end the workspace, which is far from linear.
    """
    limited = box < TUNED * machine.box
    limited[Axis.ROLL :] = True
    return tuple(int(axis) for axis in np.flatnonzero(limited))


def _nudged(poses: Array) -> Array:
    """Every pose (n, 6) with each coordinate moved a little: (6 n, 6)."""
    return (poses[:, None] + _STEP * np.eye(6)).reshape(-1, 6)
