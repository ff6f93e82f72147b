"""Moog 6DOF2000E: 32 bytes to the base, 40 bytes back, big-endian, 60 Hz."""

from __future__ import annotations

import math
import struct
from enum import IntEnum
from typing import Final

import numpy as np

from motionserver.core.axes import frozen
from motionserver.core.device import Feedback, Order, Phase
from motionserver.core.safety.setpoint import Setpoint
from motionserver.platforms.base import PlatformOptions, PlatformPacketError

_COMMAND: Final = struct.Struct(">I6fI")
_REPLY: Final = struct.Struct(">III6fI")

_FAULTS: Final = {
    0x8000: "E-stop",
    0x4000: "snubber",
    0x2000: "actuator runaway",
    0x1000: "battery",
    0x0800: "low idle rate",
    0x0400: "motor thermal",
    0x0200: "command range",
    0x0100: "invalid frame",
    0x0080: "watchdog",
    0x0040: "limit switch",
    0x0020: "drive bus",
    0x0010: "amplifier",
    0x0008: "communication",
    0x0004: "homing",
    0x0002: "envelope",
    0x0001: "torque monitor",
}
_AT_HOME: Final = 0x01
_ESTOP_SENSE: Final = 0x80
_FEEDBACK_IS_DOF: Final = 0x80


class Word(IntEnum):
    """Motion command words, in the low byte of the first word."""

    PARK = 210
    ENGAGE = 180
    START = 175
    LENGTH_MODE = 172
    DOF_MODE = 170
    RESET = 160
    NEW_POSITION = 130


_PHASES: Final = {
    0x0: ("POWER_UP", Phase.STARTING),
    0x1: ("IDLE", Phase.DOWN),
    0x2: ("STANDBY", Phase.RAISING),
    0x3: ("ENGAGED", Phase.UP),
    0x7: ("PARKING", Phase.LOWERING),
    0x8: ("FAULT1", Phase.FAULTED),
    0x9: ("FAULT2", Phase.FAULTED),
    0xA: ("FAULT3", Phase.FAULTED),
    0xB: ("DISABLED", Phase.DISABLED),
    0xC: ("INHIBITED", Phase.DISABLED),
}


class Moog6Dof2000E:
    """The Ethernet interface of the 6DOF2000E, in LENGTH or DOF mode.

    DOF words are taken as x forward, y right, z down: surge, -sway, neutral - heave, roll,
    -pitch, -yaw. LENGTH words are extensions above the retracted length. Which physical leg is
    "A" is stated nowhere: it is the option ``leg_order``.
    """

    name = "moog-6dof2000e"

    def __init__(self, options: PlatformOptions) -> None:
        self._options = options
        self._lengths = options.mode == "length"
        self._words = {
            Order.WAIT: Word.LENGTH_MODE if self._lengths else Word.DOF_MODE,
            Order.RAISE: Word(options.engage_word),
            Order.FOLLOW: Word.NEW_POSITION,
            Order.PARK: Word.PARK,
            Order.RESET: Word.RESET,
        }

    def encode(self, setpoint: Setpoint) -> bytes:
        """Write the 32-byte command of ``setpoint``."""
        if self._lengths:
            places = setpoint.legs[list(self._options.leg_order)] - self._options.length_offset
            values = tuple(float(value) for value in places)
        else:
            surge, sway, heave, roll, pitch, yaw = (float(value) for value in setpoint.state.pose)
            lift = self._options.heave_neutral - heave
            # zero minus, not minus: a minus zero would be another word on the wire
            values = (roll, 0.0 - pitch, lift, surge, 0.0 - yaw, 0.0 - sway)
        return _COMMAND.pack(self._words[setpoint.order], *values, 0)

    def decode(self, data: bytes, arrival_ns: int) -> Feedback:
        """Read the 40-byte reply of the base."""
        if len(data) != _REPLY.size:
            raise PlatformPacketError(
                "feedback_size",
                f"{self.name}: {len(data)} bytes on the platform's port, a reply has "
                f"{_REPLY.size}; another program sends here, or the format is wrong",
            )
        latched, discrete, machine, *values, _ = _REPLY.unpack(data)
        if not all(math.isfinite(value) for value in values):
            raise PlatformPacketError(
                "feedback_not_finite", f"{self.name}: the reply holds a value that is no number"
            )
        if machine & 0x0F not in _PHASES:
            raise PlatformPacketError(
                "feedback_state", f"{self.name}: unknown machine state {machine & 0x0F:#x}"
            )
        state, phase = _PHASES[machine & 0x0F]
        if phase is Phase.DOWN and not discrete & _AT_HOME:
            phase = Phase.LOWERING
        legs = pose = None
        if machine & _FEEDBACK_IS_DOF:
            roll, pitch, heave, surge, yaw, lateral = values
            lift = self._options.heave_neutral - heave
            pose = frozen([surge, -lateral, lift, roll, -pitch, -yaw])
        else:
            measured = np.empty(6)
            measured[list(self._options.leg_order)] = values
            legs = frozen(measured + self._options.length_offset)
        faults = tuple(name for bit, name in _FAULTS.items() if latched & bit)
        is_stopped, is_home = bool(discrete & _ESTOP_SENSE), bool(discrete & _AT_HOME)
        return Feedback(arrival_ns, phase, state, legs, pose, faults, is_stopped, is_home)
