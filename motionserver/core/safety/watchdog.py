"""What the guard watches: ages in its own clock, the device's answers, tracking."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from motionserver.core.axes import Array
from motionserver.core.device import Feedback, Phase
from motionserver.core.kinematics.hexapod import leg_lengths
from motionserver.core.limits import Machine
from motionserver.core.state import DriveMode

SECOND: Final = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Patience:
    """How long each silence is borne [s], and how far the platform may lag [m].

    Attributes:
        valid: Feedback without a break before it is believed.
        feedback: Silence of the device while raised; at least six of its periods.
        fresh: Source without a break before it moves the platform.
        plans: Planner periods without an accepted plan.
        hold: Longest hold, as long as its reason lasts.
        spared: Longest part of a hold that is not counted because its reason is gone.
        pause: Longest hold of a source that says it pauses.
        silence: Longest wait for a source while ready.
        raising: Longest lift.
        lowering: Bound of the device's own settling.
        gap: Gap of the guard's own loop that is only an event.
        reset: How long a reset is tried.
        track: Tracking error that is always allowed [m].
        track_lag: Further tracking error per leg speed [s].
        track_time: How long a larger error is borne.
        still: How long measured legs must not move before a plan may begin where they are.
        quiver: What counts as not moving [m].
        sound: Answers without fault and without a break before a fault is brought home.
    """

    valid: float = 0.3
    feedback: float = 0.1
    fresh: float = 0.5
    plans: int = 3
    hold: float = 2.0
    pause: float = 600.0
    silence: float = 30.0
    raising: float = 20.0
    lowering: float = 10.0
    gap: float = 0.3
    reset: float = 2.0
    track: float = 0.010
    track_lag: float = 0.15
    track_time: float = 0.1
    still: float = 0.3
    quiver: float = 0.002
    sound: float = 1.0
    spared: float = 8.0


@dataclass(frozen=True, slots=True)
class CueStatus:
    """What the planner knows of the source, re-judged here by age.

    Attributes:
        newest_ns: Arrival of the newest packet that may move the platform, CLOCK_MONOTONIC [ns];
            0 = none.
        stale_after_ns: Age beyond which it is stale [ns].
        mode: What the simulator says it is doing.
        heard_ns: Arrival of the owner's newest packet, whether it may move the platform or not
            [ns]; 0 = none yet.
        trouble: What is wrong with the packets that arrive, as a sentence for people; empty if
            nothing is. It explains, it never decides.
        looked_ns: When the planner looked [ns]; 0 = it has not reported yet. Says how late the
            planner is, nothing about the source.
    """

    newest_ns: int = 0
    stale_after_ns: int = 0
    mode: DriveMode = DriveMode.DRIVE
    heard_ns: int = 0
    trouble: str = ""
    looked_ns: int = field(default=0, compare=False)

    def is_stale(self, now_ns: int) -> bool:
        """True if nothing came for too long, or ever."""
        # a planner that claims more patience than 300 ms is not believed
        patience = min(self.stale_after_ns, 3 * SECOND // 10)
        return self.newest_ns == 0 or now_ns - self.newest_ns > patience


class SourceWatch:
    """Since when the source has been fresh and driving."""

    def __init__(self) -> None:
        self.status = CueStatus()
        self._driving_since: int | None = None
        self._silent_since: int | None = None
        # (packet, instant from which its successor is waited for anew) [ns]
        self._excused = (0, 0)

    def update(self, now_ns: int, status: CueStatus | None, is_excused: bool = False) -> None:
        """Take the newest status, or none, and judge its age now.

        Args:
            now_ns: Now [ns].
            status: What the planner knows; None = nothing new.
            is_excused: The guard itself stood still for a moment. Perhaps the whole computer did,
                and the planner has not read yet what came: a source that was fresh before is
                waited for anew, once.
        """
        self.status = status or self.status
        newest = self.status.newest_ns
        if is_excused and newest != self._excused[0] and self._silent_since is None:
            self._excused = (newest, now_ns)
        if not self.is_fresh(now_ns):
            self._driving_since = None
            self._silent_since = now_ns if self._silent_since is None else self._silent_since
            return
        self._silent_since = None
        if self.status.mode in (DriveMode.PAUSE, DriveMode.BYE):
            self._driving_since = None
        elif self._driving_since is None:
            self._driving_since = now_ns

    def is_fresh(self, now_ns: int) -> bool:
        """True if packets arrive, whatever they say."""
        packet, resumed = self._excused
        status = self.status
        if packet == status.newest_ns:
            status = replace(status, newest_ns=resumed)
        return not status.is_stale(now_ns)

    @property
    def is_paused(self) -> bool:
        """True if the newest packet says the simulator pauses."""
        return self.status.mode is DriveMode.PAUSE

    def driving_for(self, now_ns: int) -> float:
        """How long it has been fresh and driving without a break [s]."""
        return 0.0 if self._driving_since is None else (now_ns - self._driving_since) / SECOND

    def silent_for(self, now_ns: int) -> float:
        """How long it has been stale without a break [s]."""
        return 0.0 if self._silent_since is None else (now_ns - self._silent_since) / SECOND


class DeviceWatch:
    """The device's newest answer, since when it is valid, and how far the platform lags."""

    def __init__(self, machine: Machine, patience: Patience, send_period: float) -> None:
        self._machine = machine
        self._patience = patience
        self._late = max(patience.feedback, 6.0 * send_period)
        self._valid_since = self._excused_ns = self._still_since = 0
        self._astray_since: int | None = None
        self._sound_since: int | None = None
        self._excused: Feedback | None = None
        self._still_at: Array | None = None
        self.newest: Feedback | None = None
        self.error = 0.0

    def answered(self, feedback: Feedback) -> None:
        """Take a decoded answer."""
        if self.is_lost(feedback.arrival_ns):
            self._valid_since = feedback.arrival_ns
            self._still_at = self._sound_since = None
        if reports_fault(feedback) or feedback.estop:
            self._sound_since = None
        elif self._sound_since is None:
            self._sound_since = feedback.arrival_ns
        legs = measured_legs(self._machine, feedback)
        moved = legs is not None and (
            self._still_at is None
            or bool(np.any(np.abs(legs - self._still_at) > self._patience.quiver))
        )
        if moved:
            self._still_at, self._still_since = legs, feedback.arrival_ns
        self.newest = feedback

    def age(self, now_ns: int) -> float:
        """Age of the newest answer [s]; infinite before the first."""
        return float("inf") if self.newest is None else (now_ns - self.newest.arrival_ns) / SECOND

    def is_lost(self, now_ns: int) -> bool:
        """True if the device has been silent for too long."""
        if self._excused is not None and self._excused is self.newest:
            return (now_ns - self._excused_ns) / SECOND > self._late
        return self.age(now_ns) > self._late

    def current(self, now_ns: int) -> Feedback | None:
        """The newest answer; None before the first and while the device is silent for too long."""
        return None if self.is_lost(now_ns) else self.newest

    def excuse(self, now_ns: int, gap: float = 0.0) -> None:
        """The guard itself stood still, and a base answers what it is sent: wait anew, once.

        Args:
            now_ns: Now [ns].
            gap: How long it stood [s]: nothing was sent that the platform could have followed, so
                that the time of a tracking error stood as well.
        """
        if self._excused is not self.newest:
            self._excused, self._excused_ns = self.newest, now_ns
        if self._astray_since is not None:
            self._astray_since += int(gap * SECOND)

    def valid_for(self, now_ns: int) -> float:
        """How long answers have come without a break [s]."""
        if self.is_lost(now_ns):
            return 0.0
        return (now_ns - self._valid_since) / SECOND

    def sound_for(self, now_ns: int) -> float:
        """How long answers have come without a break and without a fault in any of them [s]."""
        if self._sound_since is None or self.is_lost(now_ns):
            return 0.0
        return (now_ns - self._sound_since) / SECOND

    def stands(self, now_ns: int) -> bool:
        """True if the measured legs have not moved for a while, or are not measured at all.

        What it reports is late: a plan that begins where a moving platform was would be a jump.
        """
        return self._still_at is None or (
            (now_ns - self._still_since) / SECOND >= self._patience.still
        )

    def legs(self) -> Array | None:
        """Measured pin-to-pin lengths, (6,) [m]; None if unknown."""
        return None if self.newest is None else measured_legs(self._machine, self.newest)

    def track(self, now_ns: int, legs: Array, speeds: Array) -> bool:
        """Compare with what was commanded.

        Args:
            now_ns: Now [ns].
            legs: Commanded lengths, (6,) [m].
            speeds: Commanded leg speeds, (6,) [m/s].

        Returns:
            True if the platform has been astray for too long.
        """
        measured = self.legs()
        if measured is None:
            return False
        gap = np.abs(measured - legs)
        self.error = float(gap.max())
        if bool(np.all(gap <= self.allowed(speeds))):
            self._astray_since = None
            return False
        if self._astray_since is None:
            self._astray_since = now_ns
        return (now_ns - self._astray_since) / SECOND > self._patience.track_time

    def allowed(self, speeds: Array) -> Array:
        """Tracking error that is always allowed at commanded leg speeds (6,) [m/s]: (6,) [m]."""
        largest: Array = self._patience.track + self._patience.track_lag * np.abs(speeds)
        return largest

    def forgive(self) -> None:
        """Start tracking anew: the platform is about to be told something else."""
        self._astray_since = None
        self.error = 0.0


def reports_fault(feedback: Feedback) -> bool:
    """True if the device says that it is faulty or switched off."""
    return bool(feedback.faults) or feedback.phase in (Phase.FAULTED, Phase.DISABLED)


def measured_legs(machine: Machine, feedback: Feedback) -> Array | None:
    """Pin-to-pin lengths that an answer tells, (6,) [m]; None if it tells neither legs nor pose."""
    if feedback.legs is not None:
        return feedback.legs
    return None if feedback.pose is None else leg_lengths(machine, feedback.pose)
