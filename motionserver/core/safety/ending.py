"""When a guard that was told to leave may end, and with which status."""

from __future__ import annotations

from typing import Final

from motionserver.core.device import Feedback, Phase
from motionserver.core.safety.record import GuardRecord
from motionserver.core.safety.states import LATCHED, State
from motionserver.core.safety.supervisor import is_standing
from motionserver.core.safety.watchdog import SECOND, DeviceWatch

PARKED: Final = 0
"""Status of a guard that left the platform down, or never raised it."""
STANDING: Final = 3
"""Status of a guard that left the platform where it could not bring it down."""


def exit_status(record: GuardRecord, device: DeviceWatch, began_ns: int, now_ns: int) -> int | None:
    """The status to end with now; None while the platform is still being brought down.

    Args:
        record: The guard's state; its deadline is that of parking.
        device: The device's answers.
        began_ns: When the guard began [ns].
        now_ns: Now [ns].
    """
    if record.state is State.PARKED:
        return PARKED
    newest = device.newest
    if record.state is State.OFFLINE:
        # a device that answers is found out about within a second
        if now_ns - began_ns <= SECOND:
            return None
        if newest is None or is_down(newest):
            return PARKED
    elif record.state not in LATCHED or not is_standing(record.playback):
        return None
    elif (current := device.current(now_ns)) is not None and is_down(current):
        return PARKED
    elif record.state is State.SAFE and newest is not None and newest.estop:
        # an open stop is followed: nothing that is sent would bring it down
        return STANDING
    return STANDING if now_ns > record.deadline_ns else None


def is_down(feedback: Feedback) -> bool:
    """True if the device says that it is settled, also if it is faulty."""
    if feedback.phase is Phase.DOWN:
        return True
    return feedback.is_home and feedback.phase in (Phase.FAULTED, Phase.DISABLED, Phase.STARTING)
