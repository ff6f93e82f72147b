"""Rotations Rz(yaw) Ry(pitch) Rx(roll) and specific force, batched."""

from __future__ import annotations

import numpy as np

from motionserver.core.axes import GRAVITY, Array


def rotation(angles: Array) -> Array:
    """Platform-to-world rotation matrices.

    Args:
        angles: Roll, pitch, yaw, (..., 3) [rad].

    Returns:
        R = Rz(yaw) Ry(pitch) Rx(roll), (..., 3, 3).
    """
    # rotation_rows has poses last; here they come first, whatever their shape
    return np.ascontiguousarray(rotation_rows(angles.T).T.swapaxes(-1, -2))


def rotation_rows(angles: Array) -> Array:
    """`rotation` with the poses last, so that its products run along contiguous memory.

    Args:
        angles: Roll, pitch, yaw, (3, ...) [rad].

    Returns:
        R = Rz(yaw) Ry(pitch) Rx(roll), (3, 3, ...).
    """
    (sr, sp, sy), (cr, cp, cy) = np.sin(angles), np.cos(angles)
    across, along = sp * sr, sp * cr
    return np.array(
        (
            (cy * cp, cy * across - sy * cr, cy * along + sy * sr),
            (sy * cp, sy * across + cy * cr, sy * along - cy * sr),
            (-sp, cp * sr, cp * cr),
        )
    )


def euler_rate_matrix(angles: Array) -> Array:
    """Map from (roll', pitch', yaw') to the angular velocity in world axes.

    Args:
        angles: Roll, pitch, yaw, (..., 3) [rad].

    Returns:
        E with omega = E (roll', pitch', yaw'), (..., 3, 3).
    """
    sp, cp = np.sin(angles[..., 1]), np.cos(angles[..., 1])
    sy, cy = np.sin(angles[..., 2]), np.cos(angles[..., 2])
    out = np.zeros((*angles.shape[:-1], 3, 3))
    out[..., 0, 0] = cy * cp
    out[..., 1, 0] = sy * cp
    out[..., 2, 0] = -sp
    out[..., 0, 1] = -sy
    out[..., 1, 1] = cy
    out[..., 2, 2] = 1.0
    return out


def euler_rate_matrix_dot(angles: Array, rates: Array) -> Array:
    """Time derivative of `euler_rate_matrix`, (..., 3, 3), for angle rates (..., 3) [rad/s]."""
    sp, cp = np.sin(angles[..., 1]), np.cos(angles[..., 1])
    sy, cy = np.sin(angles[..., 2]), np.cos(angles[..., 2])
    dp, dy = rates[..., 1], rates[..., 2]
    out = np.zeros((*angles.shape[:-1], 3, 3))
    out[..., 0, 0] = -sy * dy * cp - cy * sp * dp
    out[..., 1, 0] = cy * dy * cp - sy * sp * dp
    out[..., 2, 0] = -cp * dp
    out[..., 0, 1] = -cy * dy
    out[..., 1, 1] = -sy * dy
    return out


def gravity_in_body(roll: Array, pitch: Array) -> Array:
    """Specific force of a body at rest: g (-sin pitch, sin roll cos pitch, cos roll cos pitch).

    Args:
        roll: Roll, any shape [rad].
        pitch: Pitch, positive nose down, same shape [rad].

    Returns:
        Specific force in body axes, (..., 3) [m/s2].
    """
    return GRAVITY * np.stack(
        (-np.sin(pitch), np.sin(roll) * np.cos(pitch), np.cos(roll) * np.cos(pitch)), axis=-1
    )


def transfer(force: Array, rates: Array, rates_dot: Array, arm: Array) -> Array:
    """Specific force at a point carried along by a rigid body.

    Args:
        force: Specific force at the known point, (..., 3) [m/s2].
        rates: Body rates p, q, r, (..., 3) [rad/s].
        rates_dot: Their time derivatives, (..., 3) [rad/s2].
        arm: From the known point to the wanted one, body axes, (3,) [m].

    Returns:
        f + omega' x r + omega x (omega x r), (..., 3) [m/s2].
    """
    # written out: np.cross costs several times the arithmetic at these sizes
    along, square = (rates @ arm)[..., None], (rates * rates).sum(-1)[..., None]
    moved: Array = force + rates_dot @ lever(arm).T + (along * rates - square * arm)
    return moved


def lever(arm: Array) -> Array:
    """Matrix of the acceleration that turning brings at ``arm`` (3,): omega' x r = M omega'."""
    x, y, z = arm
    return np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])


def felt(pose: Array, velocity: Array, acceleration: Array, arm: Array) -> tuple[Array, Array]:
    """What a person on the platform feels, without linearising.

    Args:
        pose: Platform poses, (..., 6).
        velocity: Their derivatives, (..., 6).
        acceleration: Second derivatives, (..., 6).
        arm: Head from the motion reference point, platform axes, (3,) [m].

    Returns:
        Specific force at the head, gravity included (..., 3) [m/s2]; body rates (..., 3) [rad/s].
    """
    angles, angle_rates = pose[..., 3:], velocity[..., 3:]
    matrix = rotation(angles)
    to_world = euler_rate_matrix(angles)
    omega = np.einsum("...ij,...j->...i", to_world, angle_rates)
    omega_dot = np.einsum("...ij,...j->...i", to_world, acceleration[..., 3:]) + np.einsum(
        "...ij,...j->...i", euler_rate_matrix_dot(angles, angle_rates), angle_rates
    )
    lift = acceleration[..., :3] + np.array([0.0, 0.0, GRAVITY])
    body = np.swapaxes(matrix, -1, -2)
    rates = np.einsum("...ij,...j->...i", body, omega)
    rates_dot = np.einsum("...ij,...j->...i", body, omega_dot)
    return transfer(np.einsum("...ij,...j->...i", body, lift), rates, rates_dot, arm), rates
