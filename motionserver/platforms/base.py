"""What a platform's packet format is: setpoint to bytes, bytes to feedback."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from motionserver.core.device import Feedback
from motionserver.core.safety.setpoint import Setpoint
from motionserver.errors import MotionServerError


class PlatformPacketError(MotionServerError):
    """A datagram on the platform's port that is no answer of the device.

    Attributes:
        reason: Name of its counter.
    """

    def __init__(self, reason: str, message: str) -> None:
        super().__init__(message)
        self.reason = reason


@dataclass(frozen=True, slots=True)
class PlatformOptions:
    """What differs between two machines that speak the same format.

    Attributes:
        mode: What the packets carry: "length" or "dof".
        length_offset: Pin-to-pin length of a leg whose word is zero [m].
        leg_order: Leg 0..5 sent in each of the six places.
        heave_neutral: Heave word at neutral [m]; format specific.
        engage_word: Command word that lifts the base; format specific.
    """

    mode: str = "length"
    length_offset: float = 0.0
    leg_order: tuple[int, ...] = (0, 1, 2, 3, 4, 5)
    heave_neutral: float = -0.2286
    engage_word: int = 180


class PlatformFormat(Protocol):
    """One machine's packets. Stateless: the same setpoint gives the same bytes."""

    name: str

    def encode(self, setpoint: Setpoint) -> bytes:
        """Write the datagram that carries ``setpoint``."""
        ...

    def decode(self, data: bytes, arrival_ns: int) -> Feedback:
        """Read an answer that arrived at ``arrival_ns`` [ns].

        Raises:
            PlatformPacketError: The bytes are no answer of this device.
        """
        ...
