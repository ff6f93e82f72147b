"""The emulated machine's own leg kinematics, written from the joint table alone.

On purpose a second implementation, sharing nothing with the server: two programs that agree on a
leg length have read the same table, and one that errs is convicted by the other. Plain Python,
because six legs are little.

Axes ISO 8855 (x forward, y left, z up; positive pitch is nose down), pose = surge, sway, heave,
roll, pitch, yaw [m, rad] of the motion reference point relative to neutral, rotation
Rz(yaw) Ry(pitch) Rx(roll).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, hypot, sin

Vector3 = tuple[float, float, float]
Six = tuple[float, ...]
Twist = tuple[Vector3, Vector3]

_NEWTON_STEPS = 12
_NEWTON_RESIDUAL = 1e-10  # [m], far below what a float32 word can say


class PoseNotFoundError(ValueError):
    """No pose near the guess has these leg lengths."""


@dataclass(frozen=True, slots=True)
class HexapodGeometry:
    """Joints and legs of a hexapod; leg ``i`` joins ``base[i]`` to ``platform[i]``.

    Attributes:
        base: Six lower joints, base axes [m].
        platform: Six upper joints relative to the motion reference point, platform axes [m].
        reference_height: Height of the reference point above the base joints at neutral [m].
        leg_retracted: Pin-to-pin length of a fully retracted leg [m].
        stroke: Extension of a fully extended leg above ``leg_retracted`` [m].
    """

    base: tuple[Vector3, ...]
    platform: tuple[Vector3, ...]
    reference_height: float
    leg_retracted: float
    stroke: float

    def extensions(self, pose: Sequence[float]) -> Six:
        """Leg extensions above the retracted length, (6,) [m]; may lie outside the stroke."""
        legs, _ = self._legs(pose)
        return tuple(hypot(*leg) - self.leg_retracted for leg in legs)

    def pose(self, extensions: Sequence[float], guess: Sequence[float]) -> Six:
        """Forward kinematics by Newton's method.

        Args:
            extensions: Leg extensions, (6,) [m].
            guess: A pose nearby, (6,) [m, rad].

        Raises:
            PoseNotFoundError: The iteration does not converge from ``guess``.
        """
        pose = list(guess)
        for _ in range(_NEWTON_STEPS):
            missing = [
                want - have for want, have in zip(extensions, self.extensions(pose), strict=True)
            ]
            if max(map(abs, missing)) < _NEWTON_RESIDUAL:
                return tuple(pose)
            velocity, spin = self.twist(pose, missing)
            for axis, change in enumerate((*velocity, *_euler_rates(pose, spin))):
                pose[axis] += max(-0.3, min(0.3, change))
        raise PoseNotFoundError(
            f"no pose near {[round(x, 4) for x in guess]} has the leg extensions "
            f"{[round(x, 4) for x in extensions]} m: the legs contradict each other"
        )

    def twist(self, pose: Sequence[float], leg_rates: Sequence[float]) -> Twist:
        """Velocity of the reference point and angular velocity, both in base axes.

        Args:
            pose: Present pose, (6,) [m, rad].
            leg_rates: Leg speeds, (6,) [m/s].

        Raises:
            PoseNotFoundError: The pose is singular.
        """
        legs, arms = self._legs(pose)
        rows = []
        for leg, arm in zip(legs, arms, strict=True):
            length = hypot(*leg)
            unit = (leg[0] / length, leg[1] / length, leg[2] / length)
            rows.append([*unit, *_cross(arm, unit)])
        x = _solve(rows, leg_rates)
        return (x[0], x[1], x[2]), (x[3], x[4], x[5])

    def _legs(self, pose: Sequence[float]) -> tuple[list[Vector3], list[Vector3]]:
        """Leg vectors and lever arms of the upper joints, both in base axes [m]."""
        turn = rotation(pose)
        x, y, z = pose[0], pose[1], pose[2] + self.reference_height
        arms = [_apply(turn, joint) for joint in self.platform]
        legs = [
            (x + arm[0] - foot[0], y + arm[1] - foot[1], z + arm[2] - foot[2])
            for arm, foot in zip(arms, self.base, strict=True)
        ]
        return legs, arms


def _t2_compact() -> HexapodGeometry:
    base = ((1.2729, 0.5241), (-0.1825, 1.3644), (-1.0904, 0.8403))
    platform = ((0.5409, 0.5375), (0.1951, 0.7372), (-0.7360, 0.1997))
    # Legs count counter-clockwise from front left, so the right side mirrors in reverse order.
    return HexapodGeometry(
        base=(
            *((x, y, 0.0) for x, y in base),
            *((x, -y, 0.0) for x, y in reversed(base)),
        ),
        platform=(
            *((x, y, -0.3001) for x, y in platform),
            *((x, -y, -0.3001) for x, y in reversed(platform)),
        ),
        reference_height=0.7270 + 0.3001,
        leg_retracted=0.9022,
        stroke=0.2789,
    )


def rotation(pose: Sequence[float]) -> tuple[Vector3, Vector3, Vector3]:
    """Rows of Rz(yaw) Ry(pitch) Rx(roll), which takes platform axes to base axes."""
    cr, sr = cos(pose[3]), sin(pose[3])
    cp, sp = cos(pose[4]), sin(pose[4])
    cy, sy = cos(pose[5]), sin(pose[5])
    return (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, cp * sr, cp * cr),
    )


def to_platform_axes(pose: Sequence[float], vector: Vector3) -> Vector3:
    """A vector given in base axes, seen in platform axes."""
    a, b, c = rotation(pose)
    x, y, z = vector
    return (
        a[0] * x + b[0] * y + c[0] * z,
        a[1] * x + b[1] * y + c[1] * z,
        a[2] * x + b[2] * y + c[2] * z,
    )


def _apply(turn: tuple[Vector3, Vector3, Vector3], v: Vector3) -> Vector3:
    a, b, c = turn
    return (
        a[0] * v[0] + a[1] * v[1] + a[2] * v[2],
        b[0] * v[0] + b[1] * v[1] + b[2] * v[2],
        c[0] * v[0] + c[1] * v[1] + c[2] * v[2],
    )


def _cross(a: Vector3, b: Vector3) -> Vector3:
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def _euler_rates(pose: Sequence[float], spin: Vector3) -> Vector3:
    """Roll, pitch and yaw rates of an angular velocity in base axes, for Rz Ry Rx."""
    cp, sp = cos(pose[4]), sin(pose[4])
    cy, sy = cos(pose[5]), sin(pose[5])
    if abs(cp) < 1e-6:
        raise PoseNotFoundError("pitch of 90 deg: roll and yaw cannot be told apart")
    roll = (cy * spin[0] + sy * spin[1]) / cp
    return roll, cy * spin[1] - sy * spin[0], spin[2] + sp * roll


def _solve(rows: Sequence[Sequence[float]], right: Sequence[float]) -> list[float]:
    """Gaussian elimination with partial pivoting of a 6 x 6 system."""
    a = [[*row, r] for row, r in zip(rows, right, strict=True)]
    n = len(a)
    for k in range(n):
        pivot = max(range(k, n), key=lambda i: abs(a[i][k]))
        if not abs(a[pivot][k]) > 1e-9:
            raise PoseNotFoundError("singular pose: the legs do not hold the platform there")
        a[k], a[pivot] = a[pivot], a[k]
        for i in range(k + 1, n):
            factor = a[i][k] / a[k][k]
            for j in range(k, n + 1):
                a[i][j] -= factor * a[k][j]
    x = [0.0] * n
    for k in reversed(range(n)):
        x[k] = (a[k][n] - sum(a[k][j] * x[j] for j in range(k + 1, n))) / a[k][k]
    return x


T2_COMPACT = _t2_compact()
"""Hexapod fitted to Table 2 of Thöndel, ECMS 2014; fitted, not measured."""
