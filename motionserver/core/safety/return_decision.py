"""When a platform that stands in a latched fault may go home by itself, and what it waits for.

FAULT stays latched: no planner's plan is played and only an operator's reset makes the platform
ready again. But nobody is left up and tilted: once the plan has ended and the device has answered
without fault for a while, standing where it was sent, it is brought home and parked.
"""

from __future__ import annotations

from enum import Enum, auto
from typing import Final

import numpy as np

from motionserver.core.axes import Array
from motionserver.core.device import Feedback, Phase
from motionserver.core.safety.watchdog import SECOND, DeviceWatch, Patience, reports_fault

NEWS: Final = 500_000_000
"""Shortest time between two events about a fault's way home [ns]: devices may flicker."""


class Step(Enum):
    """What is done next with a platform that stands in a fault."""

    WAIT = auto()
    """Send the mode word."""
    PARK = auto()
    """Let the device settle by itself."""
    HOME = auto()
    """Move straight to neutral, from the rest that was played."""
    BEGIN = auto()
    """Begin at the measured place, then move to neutral: nothing was played."""
    DOWN = auto()
    """It is down."""


class _Kind(Enum):
    """What is noted once, however its words change."""

    WAITS = auto()
    FAULT = auto()
    SILENT = auto()
    STARTING = auto()
    ELSEWHERE = auto()
    REFUSED = auto()
    HOME = auto()
    PARKS = auto()
    DOWN = auto()


class ReturnDecision:
    """Decides, packet by packet, how a platform that stands in a fault comes down.

    Args:
        patience: How long the device must answer without fault.
        device: The device's answers.
    """

    def __init__(self, patience: Patience, device: DeviceWatch) -> None:
        self._patience = patience
        self._device = device
        self._seen_ns = self._noted_ns = 0
        self._phase: Phase | None = None
        self._kind: _Kind | None = None
        self.enter()

    def enter(self) -> None:
        """Begin anew: a state was entered."""
        self._since: int | None = None
        self._settles = False
        # what forbade the last try, and what was noted last
        self._refused = ""
        self._noted: _Kind | None = None
        self.status = ""
        """What is done or waited for, for people; empty outside a fault."""
        self.is_blocked = False
        """True while nothing would follow: the device is silent, or stands elsewhere."""

    def wait_again(self, why: str) -> None:
        """The way home could not be begun; it is tried again after the same wait."""
        self._since = None
        self._refused = f"it cannot go home by itself: {why}"
        self._blocked(_Kind.REFUSED, self._refused)

    def decide(self, legs: Array | None, is_played: bool, is_neutral: bool, now_ns: int) -> Step:
        """Decide what is done next; the plan has ended.

        Args:
            legs: Where the device was sent last, (6,) [m]; None if that is unknown.
            is_played: Whether a plan has led to where it stands; else it must be measured.
            is_neutral: Whether that plan ended at neutral.
            now_ns: Now [ns].
        """
        device = self._device
        newest, wait = device.newest, self._patience.sound
        settles = self._settles and device.sound_for(now_ns) >= wait
        self._settles = False
        if now_ns - self._seen_ns > self._patience.gap * SECOND:
            # nobody has looked meanwhile: a plan was played, or the guard itself stood still
            self._since = None
        self._seen_ns = now_ns
        if newest is not None and newest.phase is not self._phase:
            self._phase, self._since = newest.phase, None
        if newest is not None and reports_fault(newest):
            self._since = None
            return self._goes_on(
                _Kind.FAULT,
                Step.PARK,
                f"the device is told to park as long as it {reports(newest)}",
            )
        current = device.current(now_ns)
        if current is None:
            self._since = None
            return self._blocked(
                _Kind.SILENT,
                "the device does not answer; once it has answered without fault for "
                f"{wait:g} s it is brought home and parked",
            )
        if current.phase is Phase.DOWN:
            return self._goes_on(_Kind.DOWN, Step.DOWN, "it is down; a reset makes it ready again")
        if current.phase is Phase.STARTING:
            return self._blocked(
                _Kind.STARTING, f"the device says {current.state}; it is waited for"
            )
        if current.phase is not Phase.UP:
            # it lifts or settles by itself: to park is its own affair in either case
            return self._parks() if settles or self._has_waited(True, now_ns) else self._waits()
        if settles:
            return self._parks()
        off = self._off(legs)
        if off > self._patience.track:
            self._since = None
            return self._blocked(
                _Kind.ELSEWHERE,
                f"the platform stands {1e3 * off:.0f} mm from where it was sent: free it, or reset "
                "to bring it home from where it is measured",
            )
        if not self._has_waited(is_played or device.stands(now_ns), now_ns):
            return self._waits()
        if is_neutral:
            return self._parks()
        assumed = (
            "" if device.legs() is not None else "; it is not measured, and assumed where sent"
        )
        self._refused = ""
        return self._goes_on(
            _Kind.HOME, Step.HOME if is_played else Step.BEGIN, f"it is on its way home{assumed}"
        )

    def _has_waited(self, is_still: bool, now_ns: int) -> bool:
        """Whether it has stood so, and answered without fault, for long enough by now."""
        if not is_still:
            self._since = None
            return False
        self._since = now_ns if self._since is None else self._since
        waited = (now_ns - self._since) / SECOND
        return min(waited, self._device.sound_for(now_ns)) >= self._patience.sound

    def _parks(self) -> Step:
        self._settles = True
        return self._goes_on(_Kind.PARKS, Step.PARK, "it is being parked")

    def _waits(self) -> Step:
        if self._refused:
            return self._blocked(_Kind.REFUSED, self._refused)
        return self._goes_on(
            _Kind.WAITS,
            Step.WAIT,
            "it is brought home and parked once the device has answered without fault for "
            f"{self._patience.sound:g} s",
        )

    def _off(self, legs: Array | None) -> float:
        measured = self._device.legs()
        if measured is None or legs is None:
            return 0.0
        return float(np.max(np.abs(measured - legs)))

    def _goes_on(self, kind: _Kind, step: Step, status: str) -> Step:
        self._kind, self.status, self.is_blocked = kind, status, False
        return step

    def _blocked(self, kind: _Kind, status: str) -> Step:
        self._kind, self.status, self.is_blocked = kind, status, True
        return Step.WAIT

    def news(self, now_ns: int) -> str:
        """What is worth an event, once; empty if nothing is."""
        if self._kind in (_Kind.WAITS, self._noted) or now_ns - self._noted_ns < NEWS:
            return ""
        self._noted, self._noted_ns = self._kind, now_ns
        return self.status


def reports(newest: Feedback) -> str:
    """What a device complains of, for people."""
    return f"reports {', '.join(newest.faults) or newest.state}"
