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


class SourceFormat(Protocol):
    """One simulator's packets."""

    name: str

    def decode(self, data: bytes, arrival_ns: int) -> VehicleMotion:
        """Read one datagram that arrived at ``arrival_ns`` [ns].

        Raises:
            SourceError: The bytes are no sample; the reason names the counter.
        """
        ...
