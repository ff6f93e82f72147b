"""What a simulator's format is: bytes to one sample of vehicle motion."""

from __future__ import annotations

from typing import Protocol

from motionserver.core.state import VehicleMotion
from motionserver.errors import MotionServerError


class SourceError(MotionServerError):
    """A datagram that is no sample of this format.

    Attributes:
        reason: Name of its counter.
    """

    def __init__(self, reason: str, message: str) -> None:
        super().__init__(message)
        self.reason = reason


class OtherStreamError(SourceError):
    """A datagram of another known stream that shares the port and carries no motion.

    It is ignored under a counter of its own: nothing is wrong with it, nor with its sender.
    """


class SourceFormat(Protocol):
    """One simulator's packets.

    Axes, signs and gravity of a format are proven by the physics of at least one packet captured
    from its simulator; an encoder of our own would only mirror what the decoder assumes.

    A format without a pause of its own, whose game sends nothing while it stands, has an
    attribute ``pauses_by_silence = True``: its silence in a drive holds the platform at rest as
    long as a pause, and the drive goes on when packets return. Without it silence is a lost client.
    """

    name: str

    def decode(self, data: bytes, arrival_ns: int) -> VehicleMotion:
        """Read one datagram that arrived at ``arrival_ns`` [ns].

        Raises:
            SourceError: The bytes are no sample; the reason names the counter.
        """
        ...
