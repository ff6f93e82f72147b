"""BeamNG's MotionSim packets: 88 bytes "BNG1", little-endian, no time, no counter."""

from __future__ import annotations

import math
import struct
from typing import Final

import numpy as np

from motionserver.core.axes import frozen
from motionserver.core.kinematics.rotation import gravity_in_body
from motionserver.core.state import DriveMode, VehicleMotion
from motionserver.sources.base import OtherStreamError, SourceError

_PACKET: Final = struct.Struct("<4s21f")
FASTEST: Final = 150.0
"""A position that moves faster than this was a respawn [m/s]."""
OUTGAUGE_SIZES: Final = (92, 96)
"""Length of an OutGauge packet without and with its optional number [bytes]."""
STEP: Final = 3.0
"""And so was a step of this size beyond it [m]."""


class BeamNgSource:
    """Acceleration in X right, Y forward, Z up, without gravity: a = (accY, -accX, accZ).

    Packets captured from the game prove it (`tests/sources/test_beamng_genuine.py`), and with it
    the angles: roll is ours, pitch and yaw have the other sign. The format has neither time nor
    pause nor respawn, so silence is the pause, and a jump of position is the respawn.

    Many players send the game's OutGauge stream (speed, pedals, lights) to the same port. It
    carries no motion and is ignored.
    """

    name = "beamng"
    pauses_by_silence = True

    def __init__(self) -> None:
        self._last: tuple[int, tuple[float, ...]] | None = None

    def decode(self, data: bytes, arrival_ns: int) -> VehicleMotion:
        """Read one MotionSim packet (the extended BNG2 by its first 88 bytes)."""
        magic = data[:4]
        if len(data) in OUTGAUGE_SIZES and magic not in (b"BNG1", b"BNG2"):
            raise OtherStreamError(
                "outgauge",
                f"beamng: OutGauge packet of {len(data)} bytes, which carries no motion: "
                f"ignored. Switch MotionSim on in the game's options, on this port",
            )
        if magic not in (b"BNG1", b"BNG2"):
            raise SourceError("magic", f"beamng: magic {magic!r}, expected b'BNG1'")
        if len(data) < _PACKET.size or (magic == b"BNG1" and len(data) != _PACKET.size):
            raise SourceError("size", f"beamng: {len(data)} bytes, expected {_PACKET.size}")
        _, *values = _PACKET.unpack_from(data)
        if not all(map(math.isfinite, values)):
            raise SourceError("not_finite", "beamng: a value is no number")
        position, velocity, acceleration = values[0:3], values[3:6], values[6:9]
        roll, pitch = values[12], -values[13]
        roll_rate, pitch_rate, yaw_rate = values[15], -values[16], -values[17]
        jumped = self._jumped(arrival_ns, tuple(position))
        force = np.array([acceleration[1], -acceleration[0], acceleration[2]])
        return VehicleMotion(
            arrival_ns=arrival_ns,
            session=0,
            sequence=None,
            sender_ns=None,
            force=frozen(force + gravity_in_body(np.array(roll), np.array(pitch))),
            rates=frozen([roll_rate, pitch_rate, yaw_rate]),
            speed=math.hypot(*velocity),
            mode=DriveMode.TELEPORT if jumped else DriveMode.DRIVE,
            attitude=(roll, pitch),
            speed_known=True,
        )

    def _jumped(self, now_ns: int, position: tuple[float, ...]) -> bool:
        last, self._last = self._last, (now_ns, position)
        if last is None:
            return False
        elapsed = (now_ns - last[0]) * 1e-9
        return math.dist(last[1], position) > STEP + FASTEST * elapsed
