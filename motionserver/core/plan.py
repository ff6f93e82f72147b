"""A plan: a short trajectory of the platform that ends at rest."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from motionserver.core.axes import Array, frozen
from motionserver.core.state import PlatformState

MAX_DURATION: Final = 4.0
"""Longest cueing plan [s]."""
MAX_KNOTS: Final = 256
"""Most knots of a plan."""

FIRST_STEP: Final = 1e-4
"""Least time from a hand-over to the next knot [s]."""
KNOT_STEP: Final = 0.008
"""Least time between later knots [s]: every quintic shows at four samples of the 2 ms grid."""

_HEADER: Final = struct.Struct("<QQdII")


@dataclass(frozen=True, slots=True)
class Plan:
    """Knots joined by quintics; at rest after the last one.

    Attributes:
        plan_id: Number of this plan, unique in its planner's life.
        parent_id: Number of the accepted plan it continues.
        takeover: Instant in the parent's own time at which it takes over [s].
        times: Knot times from its own start, (K,), times[0] = 0 [s].
        pose: (K, 6) [m, rad].
        velocity: (K, 6), derivative of the pose coordinates.
        acceleration: (K, 6).
    """

    plan_id: int
    parent_id: int
    takeover: float
    times: Array
    pose: Array
    velocity: Array
    acceleration: Array
    # of no other plan, also of none that is made from this one by replacing a table
    _coefficients: list[Array] = field(default_factory=list, init=False, repr=False, compare=False)

    @property
    def duration(self) -> float:
        """Time of the last knot [s]."""
        return float(self.times[-1])

    @property
    def rest_pose(self) -> Array:
        """Where it ends, (6,)."""
        last: Array = self.pose[-1]
        return last

    def poses(self, times: Array) -> Array:
        """Poses at ``times`` (N,) >= 0 [s]: (N, 6)."""
        c, s = self._pieces(times)
        out = c[:, 5]
        for power in (4, 3, 2, 1, 0):
            out = out * s + c[:, power]
        return out

    def evaluate(self, times: Array) -> tuple[Array, Array, Array]:
        """Pose, velocity and acceleration at ``times`` (N,) >= 0 [s], each (N, 6)."""
        c, s = self._pieces(times)
        pose = ((((c[:, 5] * s + c[:, 4]) * s + c[:, 3]) * s + c[:, 2]) * s + c[:, 1]) * s + c[:, 0]
        velocity = (((5 * c[:, 5] * s + 4 * c[:, 4]) * s + 3 * c[:, 3]) * s + 2 * c[:, 2]) * s
        velocity = velocity + c[:, 1]
        acceleration = ((20 * c[:, 5] * s + 12 * c[:, 4]) * s + 6 * c[:, 3]) * s + 2 * c[:, 2]
        return pose, velocity, acceleration

    def state(self, time: float) -> PlatformState:
        """State at one instant >= 0 [s]."""
        pose, velocity, acceleration = self.evaluate(np.array([time]))
        return PlatformState(frozen(pose[0]), frozen(velocity[0]), frozen(acceleration[0]))

    def _pieces(self, times: Array) -> tuple[Array, Array]:
        """Coefficients (N, 6 powers, 6 axes) and time within the piece (N, 1)."""
        if not self._coefficients:
            self._coefficients.append(_quintics(self))
        table = self._coefficients[0]
        piece = np.searchsorted(self.times, times, side="right") - 1
        return table[piece], (times - self.times[piece])[:, None]


def _quintics(plan: Plan) -> Array:
    """Coefficients of every piece, and a last constant one: (K, 6 powers, 6 axes)."""
    count = len(plan.times)
    table = np.zeros((count, 6, 6))
    table[:, 0] = plan.pose
    table[:-1, 1] = plan.velocity[:-1]
    table[:-1, 2] = plan.acceleration[:-1] / 2.0
    step = np.diff(plan.times)[:, None]
    travel = np.diff(plan.pose, axis=0)
    v0, v1 = plan.velocity[:-1] * step, plan.velocity[1:] * step
    a0, a1 = plan.acceleration[:-1] * step**2, plan.acceleration[1:] * step**2
    table[:-1, 3] = (20 * travel - 8 * v1 - 12 * v0 - 3 * a0 + a1) / (2 * step**3)
    table[:-1, 4] = (-30 * travel + 14 * v1 + 16 * v0 + 3 * a0 - 2 * a1) / (2 * step**4)
    table[:-1, 5] = (12 * travel - 6 * (v1 + v0) + a1 - a0) / (2 * step**5)
    return table


def rest_at(pose: Array, plan_id: int = 0) -> Plan:
    """The plan that stands at ``pose`` (6,); it has no parent."""
    still = frozen(np.zeros((2, 6)))
    both = frozen(np.stack((pose, pose)))
    return Plan(plan_id, plan_id, 0.0, frozen([0.0, 0.01]), both, still, still)


def pack(plan: Plan) -> bytes:
    """Write a plan as bytes, for a mapped file."""
    count = len(plan.times)
    table = np.column_stack((plan.times, plan.pose, plan.velocity, plan.acceleration))
    head = _HEADER.pack(plan.plan_id, plan.parent_id, plan.takeover, count, 0)
    return head + table.astype("<f8").tobytes()


def unpack(data: bytes) -> Plan:
    """Read what `pack` wrote. The values are not judged here: verification does that.

    Raises:
        ValueError: The bytes are not a plan (too short, or not the length they state).
    """
    if len(data) < _HEADER.size:
        raise ValueError(f"plan: {len(data)} bytes, at least {_HEADER.size} needed")
    plan_id, parent_id, takeover, count, _ = _HEADER.unpack_from(data)
    if not 1 <= count <= 4 * MAX_KNOTS or len(data) != _HEADER.size + count * 19 * 8:
        raise ValueError(f"plan: {len(data)} bytes do not hold the {count} knots they announce")
    table = np.frombuffer(data, "<f8", offset=_HEADER.size).reshape(count, 19)
    columns = np.split(table, [1, 7, 13], axis=1)
    return Plan(
        plan_id,
        parent_id,
        takeover,
        frozen(columns[0][:, 0]),
        frozen(columns[1]),
        frozen(columns[2]),
        frozen(columns[3]),
    )
