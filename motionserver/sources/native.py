"""The server's own cue packet (`motion_protocol`), from a simulator or from a platform's sensor."""

from __future__ import annotations

import numpy as np
from motion_protocol import Cue, Flags, ProtocolError, TimedPreview, decode_cue

from motionserver.core.axes import Array, frozen
from motionserver.core.kinematics.rotation import gravity_in_body
from motionserver.core.state import DriveMode, Driver, Preview, VehicleMotion
from motionserver.sources.base import SourceError

LEVEL = frozen(gravity_in_body(np.array(0.0), np.array(0.0)))


class NativeSource:
    """Decodes native cues; with a key only signed ones are believed."""

    name = "native"

    def __init__(self, key: bytes | None = None) -> None:
        self._key = key

    def decode(self, data: bytes, arrival_ns: int) -> VehicleMotion:
        """Read one cue; acceleration becomes specific force with the packet's attitude."""
        try:
            cue = decode_cue(data, self._key)
        except ProtocolError as error:
            raise SourceError(error.reason, str(error)) from error
        gravity, rates, force, speed = LEVEL, frozen(np.zeros(3)), LEVEL, 0.0
        motion = cue.motion
        if cue.motion is not None:
            gravity = _gravity(cue)
            force = frozen(np.array(cue.motion.acceleration) + gravity)
            rates = frozen(cue.motion.rates)
            speed = cue.motion.speed or 0.0
        return VehicleMotion(
            arrival_ns=arrival_ns,
            session=cue.session,
            sequence=cue.sequence,
            sender_ns=cue.sender_time_ns,
            force=force,
            rates=rates,
            speed=speed,
            mode=DriveMode(int(cue.mode)),
            at_platform=bool(cue.flags & Flags.MEASURED_AT_PLATFORM),
            preview=_preview(cue, gravity),
            driver=_driver(cue),
            sim_time_ns=cue.sim_time_ns,
            attitude=None if motion is None else motion.attitude,
            speed_known=motion is not None and motion.speed is not None,
        )


def _gravity(cue: Cue) -> Array:
    """What must be added to the packet's values to make them specific force, (3,) [m/s2]."""
    if cue.flags & Flags.GRAVITY_INCLUDED:
        return np.zeros(3)
    if cue.motion is None or cue.motion.attitude is None:
        return LEVEL
    roll, pitch = cue.motion.attitude
    return gravity_in_body(np.array(roll), np.array(pitch))


def _preview(cue: Cue, gravity: Array) -> Preview | None:
    if cue.preview is None or not cue.preview.samples:
        return None
    samples = np.array(cue.preview.samples)
    if isinstance(cue.preview, TimedPreview):
        times = np.array(cue.preview.times)
    else:
        times = cue.preview.start + cue.preview.dt * np.arange(len(samples))
    return Preview(frozen(times), frozen(samples[:, :3] + gravity), frozen(samples[:, 3:]))


def _driver(cue: Cue) -> Driver | None:
    told = cue.driver
    if told is None:
        return None
    return Driver(told.throttle, told.brake, told.clutch, told.steering, told.gear)
