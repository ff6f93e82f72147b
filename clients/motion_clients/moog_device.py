"""A Moog 6DOF2000E as a pure model: datagrams and instants in, status packets out."""

from __future__ import annotations

from math import isfinite

from .hexapod_legs import Six
from .moog_machine import MoogMachine
from .moog_wire import (
    COMMAND_SIZE,
    CommandMode,
    DiscreteIo,
    Fault,
    Mcw,
    Status,
    decode_command,
    encode_status,
)

_KNOWN = frozenset(int(mcw) for mcw in Mcw)


class MoogDevice(MoogMachine):
    """One base as seen from the network; it answers exactly once per command it can read."""

    def receive(self, datagram: bytes, now: float) -> bytes | None:
        """Take one datagram at ``now`` [s].

        Returns:
            The 40-byte status, or None if the datagram has not the length of a command.
        """
        self.advance(now)
        if len(datagram) != COMMAND_SIZE:
            self.counters["wrong_size"] += 1
            return None
        command = decode_command(datagram)
        if command.mcw in _KNOWN and all(map(isfinite, command.words)):
            self._heard = self.now
            self._obey(Mcw(command.mcw), command.words)
        else:
            self.counters["invalid"] += 1
            self.latch_fault(Fault.INVALID_FRAME)
        return encode_status(self.status())

    def status(self) -> Status:
        """What the base would report now: a lagged and delayed position."""
        io = DiscreteIo.ESTOP_SENSE if self.is_estopped else DiscreteIo(0)
        if self.is_parked:
            io |= DiscreteIo.BASE_AT_HOME
        else:
            io |= DiscreteIo.AMPLIFIER_ENABLE | DiscreteIo.DRIVE_BUS
        words = self.feedback.extensions
        if self.mode is CommandMode.DOF:
            words = self.config.axes.to_words(self.feedback.pose())
        return Status(self.faults, io, self.state, self.mode, words)

    def _obey(self, mcw: Mcw, words: Six) -> None:
        match mcw:
            case Mcw.NEW_POSITION:
                self.go_to(words)
            case Mcw.DOF_MODE:
                self.select(CommandMode.DOF)
            case Mcw.LENGTH_MODE:
                self.select(CommandMode.LENGTH)
            case Mcw.ENGAGE | Mcw.START:
                self.engage(mcw)
            case Mcw.PARK:
                self.park()
            case Mcw.RESET:
                self.reset()
            case Mcw.DISABLE:
                self.disable()
            case Mcw.INHIBIT:
                self.inhibit()
            case Mcw.LOW_LIMIT_ENABLE | Mcw.LOW_LIMIT_DISABLE:
                pass
            case _:
                self.counters["refused"] += 1  # a base without the MDA option
