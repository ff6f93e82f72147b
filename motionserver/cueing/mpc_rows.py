"""Rows of the six-axis programme: what the legs, the threshold and the workspace allow.

Everything is written as a share of its limit. Leg lengths and speeds look at the nearer side only
and share one slack that pushes back: a nominal slightly outside must not be allowed to stay there,
and must not make the programme infeasible either.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from motionserver.core.axes import Array
from motionserver.core.kinematics.hexapod import jacobian, leg_lengths
from motionserver.core.limits import Machine
from motionserver.core.state import PlatformState
from motionserver.cueing.mpc_grid import SplineGrid
from motionserver.cueing.mpc_legs import LegExtremes, NominalLegs
from motionserver.cueing.mpc_nominal import Nominal
from motionserver.cueing.mpc_outputs import Outputs
from motionserver.cueing.mpc_workspace import WorkspaceRows
from motionserver.cueing.thondel_legs import margins_over, way_home_gains, with_way_home
from motionserver.solvers.base import INFINITE

FIRST_LENGTH: Final = 0.03
"""Before this no length changes enough to matter [s]."""
JERKY: Final = 0.4
"""Leg jerk is looked at until then [s]: later pieces are long."""
TURNING: Final = 0.25
"""From then on both sides of leg speed are looked at [s]: it may change its sign until then."""
EARLY: Final = 1.0
"""Leg acceleration is looked at until then [s]; later pieces are gentle."""
SLACK_UNIT: Final = 1e-3
"""Unit of the legs' slack, per share of a limit: in it, its high price is like the others."""
SHARE: Final = 0.92
"""Share of leg speed, acceleration and jerk that a new plan may use: linearisation errs."""


@dataclass(frozen=True, slots=True)
class Layout:
    """Where the variables are: slack of the legs, slacks of tilt rate, coefficients.

    Attributes:
        knots: Number of tilt-rate slacks.
        columns: Coefficients of one axis.
    """

    knots: int
    columns: int

    @property
    def slacks(self) -> int:
        """Variables that are slacks; they come first, and are not negative."""
        return 1 + self.knots

    @property
    def size(self) -> int:
        """Number of variables."""
        return self.slacks + 6 * self.columns


class Rows:
    """Keeps the matrix of rows and fills it anew each period.

    Args:
        machine: Geometry and limits.
        grid: The grid of plans.
        period: Planner period [s].
        box: Tuned position limits, (6,) [m, rad]; angles have rows, translations those
            tuned below the machine's.
    """

    def __init__(self, machine: Machine, grid: SplineGrid, period: float, box: Array) -> None:
        self._machine, self._grid = machine, grid
        self.layout = layout = Layout(grid.pieces, grid.pieces - 2)
        maps, knots = grid.at_nodes, grid.knots
        self._late = np.flatnonzero(grid.nodes > FIRST_LENGTH)
        self._lengths = way_home_gains(maps.pose[self._late, None])[:, 0]
        margins = margins_over(grid.nodes[self._late])
        self._rates = maps.velocity[knots]
        self._turning = np.flatnonzero(grid.nodes > TURNING)
        self._early = knots[grid.nodes[knots] <= EARLY]
        self._accelerations = maps.acceleration[self._early]
        self._jerky = knots[grid.nodes[knots] <= JERKY]
        if machine.leg_jerk is None:
            self._jerky = knots[:0]
        self._jerks = grid.basis[: len(self._jerky)]
        sizes = (
            6 * len(self._lengths),
            6 * len(grid.nodes),
            6 * len(self._turning),
            6 * len(self._early),
            6 * len(self._jerky),
            4 * len(knots),
        )
        ends = np.cumsum((0, *sizes))
        blocks = [slice(int(a), int(b)) for a, b in pairwise(ends)]
        self._length, self._speed, self._back, self._acceleration, self._jerk, self._tilt = blocks
        self._workspace = WorkspaceRows(machine, grid, box, int(ends[-1]))
        self.count = self._workspace.end
        self.matrix = np.zeros((self.count, layout.size))
        self.matrix[self._length, 0] = -SLACK_UNIT
        self.matrix[self._speed, 0] = self.matrix[self._back, 0] = -SLACK_UNIT
        self.matrix[int(ends[-1]) :, 0] = -SLACK_UNIT
        for knot in range(len(knots)):
            rows = self._tilt.start + 4 * knot
            self.matrix[rows : rows + 4, 1 + knot] = -1.0
        self._lower = np.full(self.count, -INFINITE)
        self._upper = np.full(self.count, INFINITE)
        self._half = 0.5 * (machine.leg_max - machine.leg_min)
        self._middle = 0.5 * (machine.leg_max + machine.leg_min)
        self._allowed = (1.0 - margins / self._half)[:, None]
        ways = len(self._lengths) - len(self._late)
        nodes = len(grid.nodes)
        self._looks = np.concatenate((self._late, np.arange(nodes, nodes + ways)))
        self._legs = NominalLegs(machine, grid, period, EARLY)

    def fill(
        self,
        start: PlatformState,
        nominal: Nominal,
        outputs: Outputs,
        wanted: Array,
        tilt_rate: float,
        box: Array,
    ) -> tuple[Array, Array]:
        """Linearise about ``nominal``; ``matrix`` holds the rows afterwards.

        Args:
            start: State at the hand-over.
            nominal: The motion at the nodes.
            outputs: What is felt there.
            wanted: Wanted body rates at the nodes, (N, 3) [rad/s].
            tilt_rate: Threshold of tilt coordination [rad/s].
            box: Tuned position limits, (6,) [m, rad].

        Returns:
            Lower and upper bounds, (m,) each.
        """
        machine, knots, late = self._machine, self._grid.knots, self._late
        begin = np.stack((start.pose, start.velocity, start.acceleration))
        seen = self._legs.of(begin, nominal.jerks)
        home = with_way_home(nominal.pose, machine.parked_pose)
        gradient = jacobian(machine, home)
        count = len(nominal.pose)
        length = seen.length.around(late)
        way = leg_lengths(machine, home[count:])
        self._near(
            self._length,
            gradient[self._looks] / self._half,
            self._lengths,
            (np.concatenate((length.high, way)) - self._middle) / self._half,
            (np.concatenate((length.low, way)) - self._middle) / self._half,
            self._allowed,
        )
        self._speeds(gradient[:count] / machine.leg_speed, seen)
        limit, early = machine.leg_acceleration, seen.acceleration.around(self._early)
        self._both(
            self._acceleration,
            gradient[self._early] / limit,
            self._accelerations,
            early.high / limit,
            early.low / limit,
        )
        if machine.leg_jerk is not None:
            limit = machine.leg_jerk
            self._both(
                self._jerk,
                gradient[self._jerky] / limit,
                self._jerks,
                seen.jerk.high[self._jerky] / limit,
                seen.jerk.low[self._jerky] / limit,
            )
        self._tilting(outputs, wanted[knots, :2], tilt_rate)
        self._workspace.fill(nominal, box, self._put_single, self._leave)
        return self._lower, self._upper

    @property
    def axes(self) -> tuple[int, ...]:
        """Axes whose position limit has rows."""
        return self._workspace.axes

    def shares(self, x: Array) -> dict[str, float]:
        """Share of each limit that a solution uses, by name; 1 is all that its rows allow."""
        slacks = self.layout.slacks
        change = self.matrix[:, slacks:] @ x[slacks:]
        upper = 1.0 - (self._upper - change)
        used = np.maximum(upper, 1.0 - (change - self._lower))
        blocks = {
            "leg length": self._length,
            "leg speed": slice(self._speed.start, self._back.stop),
            "leg acceleration": self._acceleration,
            "leg jerk": self._jerk,
            "tilt rate": self._tilt,
            **self._workspace.blocks(),
        }
        return {
            name: round(max(0.0, float(used[rows].max())), 4)
            for name, rows in blocks.items()
            if rows.stop > rows.start
        }

    def _put_single(self, rows: slice, gradient: Array, gains: Array, room: Array) -> None:
        block = gradient[..., None] * gains[:, None, :]
        self.matrix[rows, self.layout.slacks :] = block.reshape(len(room), -1)
        self._upper[rows] = room

    def _leave(self, rows: slice) -> None:
        self.matrix[rows, self.layout.slacks :] = 0.0
        self._upper[rows] = INFINITE

    def _near(
        self,
        rows: slice,
        gradient: Array,
        gains: Array,
        high: Array,
        low: Array,
        allowed: Array | float,
    ) -> None:
        """The side of the limit that the nominal comes nearer to."""
        over = high >= -low
        self._put(rows, np.where(over, 1.0, -1.0)[..., None] * gradient, gains)
        self._upper[rows] = (allowed - np.where(over, high, -low)).ravel()

    def _speeds(self, gradient: Array, seen: LegExtremes) -> None:
        nodes, turning, limit = np.arange(len(gradient)), self._turning, self._machine.leg_speed
        speed = seen.speed.around(nodes)
        high, low, gains = speed.high / limit, speed.low / limit, self._grid.at_nodes.velocity
        self._near(self._speed, gradient, gains, high, low, SHARE)
        over = (high >= -low)[turning]
        self._put(
            self._back, np.where(over, -1.0, 1.0)[..., None] * gradient[turning], gains[turning]
        )
        room = SHARE - np.where(over, -low[turning], high[turning])
        self._upper[self._back] = room.ravel()

    def _both(self, rows: slice, gradient: Array, gains: Array, high: Array, low: Array) -> None:
        self._put(rows, gradient, gains)
        self._upper[rows] = (SHARE - high).ravel()
        self._lower[rows] = (-SHARE - low).ravel()

    def _put(self, rows: slice, gradient: Array, gains: Array) -> None:
        """Write gradient (n, 6 legs, 6 axes) times gains (n, K) into the coefficients' columns."""
        target = self.matrix[rows, self.layout.slacks :]
        shape = (len(gradient), gradient.shape[1], 6, self.layout.columns)
        block = gradient[..., None] * gains[:, None, None, :]
        target[...] = block.reshape(shape[0] * shape[1], -1)

    def _tilting(self, outputs: Outputs, wanted: Array, limit: float) -> None:
        """Roll and pitch rate beyond what the vehicle itself does, per knot four rows."""
        knots = self._grid.knots
        scaled = outputs.by_velocity[knots, :2] / limit
        gradient = np.zeros((len(knots), 4, 6))
        gradient[:, :2, 3:], gradient[:, 2:, 3:] = scaled, -scaled
        self._put(self._tilt, gradient, self._rates)
        value = outputs.value[knots, 3:5] / limit
        above = 1.0 + np.maximum(wanted, 0.0) / limit - value
        below = 1.0 - np.minimum(wanted, 0.0) / limit + value
        self._upper[self._tilt] = np.concatenate((above, below), axis=1).ravel()
