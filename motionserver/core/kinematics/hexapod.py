"""Inverse kinematics of the hexapod: leg lengths, speeds, accelerations, Jacobian."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from motionserver.core.axes import Array, Bools, frozen
from motionserver.core.kinematics.rotation import (
    euler_rate_matrix,
    rotation,
    rotation_rows,
)
from motionserver.core.limits import Machine


@dataclass(frozen=True, slots=True)
class LegDirections:
    """Where the legs point, in world axes.

    Attributes:
        unit: From base joint to platform joint, (N, 6, 3).
        lengths: (N, 6) [m].
        arms: R P_i, on which they act, (N, 6, 3) [m].
        to_body: R', (N, 3, 3).
    """

    unit: Array
    lengths: Array
    arms: Array
    to_body: Array


def leg_directions(machine: Machine, poses: Array) -> LegDirections:
    """Look at poses (N, 6) once, for all that can be asked about them."""
    to_body = np.swapaxes(rotation(poses[:, 3:]), -1, -2)
    arms = np.matmul(machine.platform_joints, to_body)
    legs = poses[:, None, :3] - machine.base_joints
    legs[..., 2] += machine.neutral_height
    legs += arms
    lengths = np.sqrt(np.einsum("nij,nij->ni", legs, legs))
    legs /= lengths[..., None]
    return LegDirections(legs, lengths, arms, to_body)


def leg_lengths(machine: Machine, poses: Array) -> Array:
    """Pin-to-pin leg lengths for poses (N, 6) or one pose (6,): (N, 6) or (6,) [m]."""
    # coordinates first, poses last: every operation runs along contiguous memory
    batch = np.ascontiguousarray(np.atleast_2d(poses).T)
    legs = np.matmul(machine.platform_joints, rotation_rows(batch[3:]))
    legs += batch[:3, None]
    legs -= _base_from_reference(machine)
    legs *= legs
    lengths: Array = np.sqrt(legs[0] + legs[1] + legs[2]).T
    return lengths if poses.ndim == 2 else lengths[0]


def jacobian(machine: Machine, poses: Array) -> Array:
    """Derivative of the leg lengths by the pose coordinates (Euler rates included).

    Args:
        machine: Geometry.
        poses: (N, 6).

    Returns:
        J_E with l' = J_E q', (N, 6 legs, 6 axes).
    """
    out = _jacobian(leg_directions(machine, poses))
    out[..., 3:] = np.matmul(out[..., 3:], euler_rate_matrix(poses[:, 3:]))
    return out


def _jacobian(seen: LegDirections) -> Array:
    """Rows [n_i, R P_i x n_i] for the twist (v, omega) in world axes, (N, 6, 6)."""
    return np.concatenate((seen.unit, _cross(seen.arms, seen.unit)), axis=-1)


def leg_speeds(machine: Machine, pose: Array, velocity: Array) -> tuple[Array, Array]:
    """Leg lengths and speeds of moving poses: l' = n . (p' + omega x RP).

    Args:
        machine: Geometry.
        pose: (N, 6).
        velocity: (N, 6).

    Returns:
        Lengths [m], speeds [m/s], each (N, 6).
    """
    omega = np.einsum("nij,nj->ni", euler_rate_matrix(pose[:, 3:]), velocity[:, 3:])
    seen = leg_directions(machine, pose)
    motion = velocity[:, None, :3] + _cross(omega[:, None, :], seen.arms)
    return seen.lengths, np.einsum("nij,nij->ni", seen.unit, motion)


def _cross(a: Array, b: Array) -> Array:
    """Vector products along the last axis; np.cross costs several times the arithmetic here."""
    out: Array = np.empty(np.broadcast_shapes(a.shape, b.shape))
    out[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    out[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    out[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return out


def joint_angles(machine: Machine, poses: Array, seen: LegDirections | None = None) -> Array:
    """Swing of each leg's two joints about the neutral leg direction, (N, 2, 6) [rad].

    Index 0 is the base end, 1 the platform end. ``seen``: the poses' `leg_directions`, if known.
    """
    axis = _neutral_directions(machine)
    seen = seen or leg_directions(machine, poses)
    carried = np.matmul(axis, seen.to_body)
    cosines = np.empty((len(poses), 2, 6))
    np.einsum("nij,ij->ni", seen.unit, axis, out=cosines[:, 0])
    np.einsum("nij,nij->ni", seen.unit, carried, out=cosines[:, 1])
    swing: Array = np.arccos(np.clip(cosines, -1.0, 1.0))
    return swing


def conditioning(machine: Machine, poses: Array) -> Array:
    """Smallest singular value of the twist Jacobian, angles scaled by the platform radius, (N,)."""
    rows = _scaled_jacobian(machine, leg_directions(machine, poses))
    smallest = np.linalg.svd(rows, compute_uv=False)[:, -1]
    return smallest.astype(np.float64, copy=False)


def is_conditioned(
    machine: Machine, poses: Array, least: float, seen: LegDirections | None = None
) -> bool:
    """True if `conditioning` is at least ``least`` at all poses (N, 6); cheaper than its values.

    ``seen``: the poses' `leg_directions`, if known.
    """
    doubtful = ~surely_conditioned(machine, poses, least, seen)
    return not doubtful.any() or bool(conditioning(machine, poses[doubtful]).min() >= least)


def surely_conditioned(
    machine: Machine, poses: Array, least: float, seen: LegDirections | None = None
) -> Bools:
    """True where a bound tells already that `conditioning` is at least ``least``, (N,).

    1 / |J^-1| in the Frobenius norm never exceeds the smallest singular value, so the costly
    decomposition is needed for those poses only whose bound is too small.
    """
    rows = _scaled_jacobian(machine, seen or leg_directions(machine, poses))
    try:
        inverse = np.linalg.inv(rows)
    except np.linalg.LinAlgError:
        return np.zeros(len(poses), dtype=bool)
    sure: Bools = np.einsum("nij,nij->n", inverse, inverse) * least**2 <= 1.0
    return sure


def _scaled_jacobian(machine: Machine, seen: LegDirections) -> Array:
    rows = _jacobian(seen)
    rows[..., 3:] /= _platform_radius(machine)
    return rows


@lru_cache(maxsize=16)
def _platform_radius(machine: Machine) -> float:
    """Mean distance of the platform joints from the reference point's axis [m]."""
    return float(np.mean(np.hypot(*machine.platform_joints[:, :2].T)))


@lru_cache(maxsize=16)
def _base_from_reference(machine: Machine) -> Array:
    """Base joints as seen from the reference point at neutral, (3, 6, 1) [m]."""
    seen = machine.base_joints.T - np.array([[0.0], [0.0], [machine.neutral_height]])
    return frozen(seen[..., None])


@lru_cache(maxsize=16)
def neutral_conditioning(machine: Machine) -> float:
    """`conditioning` of the neutral pose, the yardstick of all others."""
    return float(conditioning(machine, np.zeros((1, 6)))[0])


@lru_cache(maxsize=16)
def _neutral_directions(machine: Machine) -> Array:
    return frozen(leg_directions(machine, np.zeros((1, 6))).unit[0])
