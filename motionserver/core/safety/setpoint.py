"""A setpoint: what goes to the platform. Only `core.safety` makes one."""

from __future__ import annotations

from dataclasses import dataclass

from motionserver.core.axes import Array
from motionserver.core.device import Order
from motionserver.core.state import PlatformState


@dataclass(frozen=True, slots=True)
class Setpoint:
    """One frame for the platform.

    Attributes:
        order: What is asked of the device.
        state: Pose, velocity and acceleration that are played.
        legs: Pin-to-pin leg lengths of the pose, (6,) [m].
    """

    order: Order
    state: PlatformState
    legs: Array
