"""What the person feels at the nodes, and how it changes with the motion there.

Specific force at the head f = R'(p'' + g e_z) + w' x r + w x (w x r) and body rates w, both
exactly at the nominal, and linearised about it. Terms that are of second order in the rates stay
as they are at the nominal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from motionserver.core.axes import GRAVITY, Array
from motionserver.core.kinematics.rotation import lever, transfer


@dataclass(frozen=True, slots=True)
class Outputs:
    """Six outputs: specific force minus g e_z (3) and body rates (3).

    Attributes:
        value: At the nominal, (N, 6).
        by_pose: Derivative by the angles, (N, 6 outputs, 3 angles).
        by_velocity: Derivative by the angle rates, (N, 3 rates, 3 angles).
        by_acceleration: Derivative of the force by the pose's acceleration, (N, 3, 6 axes).
    """

    value: Array
    by_pose: Array
    by_velocity: Array
    by_acceleration: Array


def linearise(pose: Array, velocity: Array, acceleration: Array, arm: Array) -> Outputs:
    """Outputs about a nominal motion.

    Args:
        pose: (N, 6).
        velocity: (N, 6).
        acceleration: (N, 6).
        arm: Head from the reference point, platform axes, (3,) [m].
    """
    count = len(pose)
    sine, cosine = np.sin(pose[:, 3:]).T, np.cos(pose[:, 3:]).T
    (sr, sp, sy), (cr, cp, cy) = sine, cosine
    zero, one = np.zeros(count), np.ones(count)
    # rows of R' = Rx' Ry' Rz' (world to body), and of T with w = T (roll', pitch', yaw')
    to_body = np.array(
        [
            [cy * cp, sy * cp, -sp],
            [cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr],
            [cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr],
        ]
    ).transpose(2, 0, 1)
    rates_of = np.array([[one, zero, -sp], [zero, cr, cp * sr], [zero, -sr, cp * cr]]).transpose(
        2, 0, 1
    )
    roll_rate, pitch_rate, yaw_rate = velocity[:, 3:].T
    lift = acceleration[:, :3] + np.array([0.0, 0.0, GRAVITY])
    plain = np.einsum("nij,nj->ni", to_body, lift)
    omega = np.einsum("nij,nj->ni", rates_of, velocity[:, 3:])
    # T' (roll', pitch', yaw')
    drift = np.stack(
        (
            -cp * pitch_rate * yaw_rate,
            -sr * roll_rate * pitch_rate + (-sp * sr * pitch_rate + cp * cr * roll_rate) * yaw_rate,
            -cr * roll_rate * pitch_rate - (sp * cr * pitch_rate + cp * sr * roll_rate) * yaw_rate,
        ),
        axis=1,
    )
    omega_dot = np.einsum("nij,nj->ni", rates_of, acceleration[:, 3:]) + drift
    value = np.empty((count, 6))
    value[:, :3] = transfer(plain, omega, omega_dot, arm)
    value[:, 2] -= GRAVITY
    value[:, 3:] = omega

    by_pose = np.zeros((count, 6, 3))
    fx, fy, fz = plain.T
    by_pose[:, 1, 0], by_pose[:, 2, 0] = fz, -fy
    # pitch turns about the axis that roll carries along: f' = f x (0, cos roll, -sin roll)
    by_pose[:, 0, 1] = -fy * sr - fz * cr
    by_pose[:, 1, 1] = fx * sr
    by_pose[:, 2, 1] = fx * cr
    # yaw about the world's vertical as seen in the body
    vx, vy, vz = to_body[:, :, 2].T
    by_pose[:, 0, 2] = fy * vz - fz * vy
    by_pose[:, 1, 2] = fz * vx - fx * vz
    by_pose[:, 2, 2] = fx * vy - fy * vx
    by_acceleration = np.empty((count, 3, 6))
    by_acceleration[:, :, :3] = to_body
    by_acceleration[:, :, 3:] = lever(arm) @ rates_of
    return Outputs(value, by_pose, rates_of, by_acceleration)
