"""What a platform can be told and what it answers, whatever its packet format."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from motionserver.core.axes import Array


class Order(StrEnum):
    """What a setpoint asks of the device."""

    WAIT = "wait"
    """Say the mode word, which moves nothing, so that a base that answers per packet answers."""
    RAISE = "raise"
    """Lift to neutral by itself."""
    FOLLOW = "follow"
    """Go to this setpoint now."""
    PARK = "park"
    """Settle by itself, from neutral."""
    RESET = "reset"
    """Forget latched faults."""


class Phase(StrEnum):
    """Where the device says it is."""

    STARTING = "starting"
    DOWN = "down"
    RAISING = "raising"
    UP = "up"
    LOWERING = "lowering"
    FAULTED = "faulted"
    DISABLED = "disabled"


@dataclass(frozen=True, slots=True)
class Feedback:
    """One decoded answer of the device.

    Attributes:
        arrival_ns: When it arrived, CLOCK_MONOTONIC [ns].
        phase: Where the device says it is.
        state: The device's own word for it.
        legs: Measured pin-to-pin leg lengths, (6,) [m]; None if the format has none.
        pose: Measured pose, (6,) [m, rad]; None if the format gives legs.
        faults: Names of the device's faults, latched ones included.
        estop: True while the emergency stop or an interlock is open.
        is_home: True while the device's own switch says that it is settled, whatever its phase.
    """

    arrival_ns: int
    phase: Phase
    state: str
    legs: Array | None = None
    pose: Array | None = None
    faults: tuple[str, ...] = ()
    estop: bool = False
    is_home: bool = False
