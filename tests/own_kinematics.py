"""Kinematics and quintics for tests only: written apart from the product, to convict it."""

import numpy as np
from scipy.spatial.transform import Rotation


def lengths(machine, poses):
    """Leg lengths of poses (N, 6): (N, 6)."""
    poses = np.atleast_2d(poses)
    turn = Rotation.from_euler("ZYX", np.array(poses[:, [5, 4, 3]]))
    out = np.empty((len(poses), 6))
    lift = np.array([0.0, 0.0, machine.neutral_height])
    for leg in range(6):
        top = turn.apply(np.array(machine.platform_joints[leg])) + poses[:, :3] + lift
        out[:, leg] = np.linalg.norm(top - machine.base_joints[leg], axis=1)
    return out


# rows: value, first and second derivative of t^0..t^5 at 0, then at 1
_HERMITE = np.linalg.inv(
    [
        [1, 0, 0, 0, 0, 0],
        [0, 1, 0, 0, 0, 0],
        [0, 0, 2, 0, 0, 0],
        [1, 1, 1, 1, 1, 1],
        [0, 1, 2, 3, 4, 5],
        [0, 0, 2, 6, 12, 20],
    ]
)


def quintic_poses(plan, instants):
    """Poses of a plan at instants (N,) of its own time; constant after its end."""
    times = np.asarray(plan.times)
    inside = np.minimum(np.asarray(instants, dtype=float), times[-1])
    piece = np.clip(np.searchsorted(times, inside, side="right") - 1, 0, len(times) - 2)
    span = (times[piece + 1] - times[piece])[:, None]
    ends = np.stack(
        (
            plan.pose[piece],
            plan.velocity[piece] * span,
            plan.acceleration[piece] * span**2,
            plan.pose[piece + 1],
            plan.velocity[piece + 1] * span,
            plan.acceleration[piece + 1] * span**2,
        ),
        axis=1,
    )
    share = ((inside - times[piece]) / span[:, 0])[:, None] ** np.arange(6)
    return np.einsum("np,pq,nqa->na", share, _HERMITE, ends)


def worst(machine, poses, period):
    """Shares of the limits that leg lengths and their differences use; above 1 is a violation."""
    legs = lengths(machine, poses)
    middle = (machine.leg_max + machine.leg_min) / 2
    out = {"length": float(np.abs(legs - middle).max() / (machine.leg_max - middle))}
    moved = legs
    for name, limit in (
        ("speed", machine.leg_speed),
        ("acceleration", machine.leg_acceleration),
        ("jerk", machine.leg_jerk),
    ):
        moved = np.diff(moved, axis=0) / period
        if limit is not None and len(moved):
            out[name] = float(np.abs(moved).max() / limit)
    return out
