"""BeamNG's MotionSim packet, written from a recording: 88 bytes, magic BNG1.

Packets captured from the game prove its axes: acceleration in X right, Y forward, Z up, gravity
not included, so (accX, accY, accZ) = (-ay, ax, az) of ISO 8855; at heading zero the vehicle points
along the world's Y. rollPos is positive with the right side down (the left side up), pitchPos and
pitchVel are positive nose UP, yawPos and yawVel positive to the RIGHT. The sign of rollVel is not
proven; it is taken to follow rollPos. The packet has neither time nor counter; angular
accelerations are differences of rates, as in the game.
"""

from __future__ import annotations

import struct
from math import cos, sin
from typing import Final

from .recording import RecordedSample

MOTIONSIM: Final = struct.Struct("<4s21f")
MAGIC: Final = b"BNG1"
_STEEP: Final = 0.01  # cosine of the pitch below which the heading rate is not defined


class MotionSimEncoder:
    """Dead-reckons heading and position along a recording and writes each sample as a packet."""

    def __init__(self) -> None:
        self._last: RecordedSample | None = None
        self._yaw = 0.0
        self._position = [0.0, 0.0, 0.0]

    def encode(self, sample: RecordedSample) -> bytes:
        """Write one sample, which follows the one before in time; an earlier time starts anew."""
        last = self._last
        if last is not None and sample.time <= last.time:
            self._yaw, self._position, last = 0.0, [0.0, 0.0, 0.0], None
        p, q, r = sample.rates
        roll, pitch = sample.attitude
        yaw_rate = (q * sin(roll) + r * cos(roll)) / cos(pitch) if cos(pitch) > _STEEP else 0.0
        angular = (0.0, 0.0, 0.0)
        dt = 0.0
        if last is not None:
            dt = sample.time - last.time
            angular = (
                (p - last.rates[0]) / dt,
                -(q - last.rates[1]) / dt,
                -(r - last.rates[2]) / dt,
            )
        self._yaw += yaw_rate * dt
        yaw = self._yaw
        velocity = _to_world(
            sample.speed * cos(yaw) * cos(pitch),
            sample.speed * sin(yaw) * cos(pitch),
            -sample.speed * sin(pitch),
        )
        up = _to_world(
            cos(yaw) * sin(pitch) * cos(roll) + sin(yaw) * sin(roll),
            sin(yaw) * sin(pitch) * cos(roll) - cos(yaw) * sin(roll),
            cos(pitch) * cos(roll),
        )
        self._position = [x + v * dt for x, v in zip(self._position, velocity, strict=True)]
        self._last = sample
        ax, ay, az = sample.acceleration
        return MOTIONSIM.pack(
            MAGIC,
            *self._position,
            *velocity,
            *(-ay, ax, az),
            *up,
            *(roll, -pitch, -yaw),
            *(p, -q, -r),
            *angular,
        )


def _to_world(x: float, y: float, z: float) -> tuple[float, float, float]:
    # x forward and y left at heading zero; the game's world has X right and Y forward there
    return -y, x, z
