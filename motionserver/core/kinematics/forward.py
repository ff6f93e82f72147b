"""Forward kinematics: the pose that gives measured leg lengths, by Newton's method."""

from __future__ import annotations

import numpy as np

from motionserver.core.axes import Array
from motionserver.core.kinematics.hexapod import jacobian, leg_lengths
from motionserver.core.limits import Machine

ITERATIONS = 20
TOLERANCE = 1e-9


class NoPoseError(ValueError):
    """No pose gives these leg lengths; carries the worst remaining error [m]."""

    def __init__(self, residual: float) -> None:
        super().__init__(
            f"forward kinematics: no pose found for the measured legs after {ITERATIONS} steps "
            f"(left over: {residual * 1e3:.3f} mm, allowed: {TOLERANCE * 1e3:g} mm); "
            "check the leg order, the length offset and the geometry of the machine's file"
        )
        self.residual = residual


def forward(machine: Machine, lengths: Array, start: Array | None = None) -> Array:
    """Find the pose of measured leg lengths.

    Args:
        machine: Geometry.
        lengths: Pin-to-pin lengths, (6,) [m].
        start: Pose to start from, (6,); neutral if None.

    Returns:
        Pose (6,) [m, rad].

    Raises:
        NoPoseError: Newton's method q <- q + J^-1 (l - l(q)) did not converge.
    """
    pose = np.zeros(6) if start is None else np.array(start, dtype=np.float64)
    residual = float("inf")
    for _ in range(ITERATIONS):
        error = lengths - leg_lengths(machine, pose)
        residual = float(np.max(np.abs(error)))
        if residual <= TOLERANCE:
            return pose
        if not np.isfinite(residual):
            break
        try:
            step = np.linalg.solve(jacobian(machine, pose[None])[0], error)
        except np.linalg.LinAlgError:
            break
        # half a metre or radian at most: a far start must not be thrown out of the workspace
        pose = pose + step * min(1.0, 0.5 / max(float(np.max(np.abs(step))), 1e-12))
    raise NoPoseError(residual)
