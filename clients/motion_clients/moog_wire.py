"""Device side of the Moog 6DOF2000E packets: commands are decoded, status is encoded.

Host to base 32 bytes, base to host 40 bytes, all words 32 bit big-endian. The host side of the
format is another program's business; both are written from the byte table, so that one can
convict the other.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum, IntFlag

from .hexapod_legs import Six

COMMAND_SIZE = 32
STATUS_SIZE = 40

_COMMAND = struct.Struct("!I6fI")
_STATUS = struct.Struct("!3I6fI")


class Mcw(IntEnum):
    """Mode control words a base knows; the low byte of word 0."""

    NEW_MDA = 128
    NEW_POSITION = 130
    MDA_MODE = 140
    INHIBIT = 150
    NEW_MDA_FILE = 155
    RESET = 160
    DOF_MODE = 170
    LENGTH_MODE = 172
    START = 175
    ENGAGE = 180
    LOW_LIMIT_DISABLE = 190
    LOW_LIMIT_ENABLE = 200
    PARK = 210
    DISABLE = 220


class MachineState(IntEnum):
    """State of the base; the low four bits of status word 2."""

    POWER_UP = 0
    IDLE = 1
    STANDBY = 2
    ENGAGED = 3
    PARKING = 7
    FAULT1 = 8
    FAULT2 = 9
    FAULT3 = 10
    DISABLED = 11
    INHIBITED = 12


class Fault(IntFlag):
    """Latched faults; status word 0."""

    TORQUE_MONITOR = 0x0001
    ENVELOPE = 0x0002
    HOMING = 0x0004
    COMM = 0x0008
    AMPLIFIER = 0x0010
    DRIVE_BUS = 0x0020
    LIMIT_SWITCH = 0x0040
    WATCHDOG = 0x0080
    INVALID_FRAME = 0x0100
    COMMAND_RANGE = 0x0200
    MOTOR_THERMAL = 0x0400
    LOW_IDLE_RATE = 0x0800
    BATTERY = 0x1000
    ACTUATOR_RUNAWAY = 0x2000
    SNUBBER = 0x4000
    ESTOP = 0x8000


class DiscreteIo(IntFlag):
    """Digital inputs and outputs; status word 1."""

    BASE_AT_HOME = 0x01
    THERMAL = 0x02
    AMPLIFIER_FAULT = 0x04
    LIMIT_SWITCH = 0x08
    LIMIT_SHUNT = 0x10
    DRIVE_BUS = 0x20
    AMPLIFIER_ENABLE = 0x40
    ESTOP_SENSE = 0x80


class CommandMode(IntEnum):
    """How the six floats of a command are read; bits 6-5 of status word 2."""

    LENGTH = 0
    DOF = 1


@dataclass(frozen=True, slots=True)
class Command:
    """One 32-byte command as received, not yet judged.

    Attributes:
        mcw: Low byte of word 0; may be no known :class:`Mcw`.
        words: The six floats in wire order: roll, pitch, heave, surge, yaw, lateral [rad, m] in
            DOF mode, extensions A to F [m] in LENGTH mode. May be NaN or infinite.
    """

    mcw: int
    words: Six


@dataclass(frozen=True, slots=True)
class Status:
    """One 40-byte status; ``words`` in the order of :class:`Command`, read as ``mode`` says."""

    faults: Fault
    discrete_io: DiscreteIo
    state: MachineState
    mode: CommandMode
    words: Six


@dataclass(frozen=True, slots=True)
class DofAxes:
    """How the DOF words of this base name a pose.

    Attributes:
        heave_neutral: Heave word at the neutral pose [m]; 0 for software revision E16.
        signs: Sign of each wire word against ISO 8855, in wire order. The base's axes are taken
            as x forward, y right, z down.
    """

    heave_neutral: float = -0.2286
    signs: tuple[int, int, int, int, int, int] = (1, -1, -1, 1, -1, -1)

    def to_pose(self, words: Sequence[float]) -> Six:
        """ISO 8855 pose (surge, sway, heave, roll, pitch, yaw) [m, rad] of six DOF words."""
        roll, pitch, heave, surge, yaw, sway = (
            sign * (word - zero)
            for sign, word, zero in zip(self.signs, words, self._zeros, strict=True)
        )
        return surge, sway, heave, roll, pitch, yaw

    def to_words(self, pose: Sequence[float]) -> Six:
        """Six DOF words of an ISO 8855 pose (6,) [m, rad]."""
        surge, sway, heave, roll, pitch, yaw = pose
        return tuple(
            sign * value + zero
            for sign, value, zero in zip(
                self.signs, (roll, pitch, heave, surge, yaw, sway), self._zeros, strict=True
            )
        )

    @property
    def _zeros(self) -> Six:
        return 0.0, 0.0, self.heave_neutral, 0.0, 0.0, 0.0


def decode_command(datagram: bytes) -> Command:
    """Read a command.

    Raises:
        ValueError: The datagram is not 32 bytes long.
    """
    if len(datagram) != COMMAND_SIZE:
        raise ValueError(
            f"Moog command: {len(datagram)} bytes; a command has exactly {COMMAND_SIZE}"
        )
    word, *values, _spare = _COMMAND.unpack(datagram)
    # Only the low byte commands; a host in MDA mode puts a file number above it.
    return Command(mcw=word & 0xFF, words=tuple(values))


def encode_status(status: Status) -> bytes:
    """Write a status."""
    machine = status.mode << 7 | status.mode << 5 | status.state
    return _STATUS.pack(status.faults, status.discrete_io, machine, *status.words, 0)
