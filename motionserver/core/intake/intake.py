"""From the newest believed packet to a stimulus: head point, scale, spikes, teleports, fades."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from motionserver.core.axes import GRAVITY, Array, frozen
from motionserver.core.kinematics.rotation import transfer
from motionserver.core.state import STILL, DriveMode, Preview, Stimulus, VehicleMotion

FADE_IN: Final = 1.0
"""From nothing to the whole cue when a drive begins or comes back [s]."""
FADE_OUT: Final = 0.3
"""From the whole cue to nothing when the source is stale or pauses [s]."""
FORCE_MAX: Final = 3.0 * GRAVITY
"""Larger wishes are cut to this, each axis [m/s2]."""
RATE_MAX: Final = float(np.radians(200.0))
"""Larger wishes are cut to this, each axis [rad/s]."""
SLEW: Final = 2000.0
"""Fastest change of the wanted force, each axis [m/s3]."""
JUMP: Final = 2.0
"""Change of speed beyond 3 g that tells a teleport [m/s]."""
_UP: Final = np.array([0.0, 0.0, GRAVITY])


@dataclass(frozen=True, slots=True)
class Head:
    """Where the vehicle's driver sits, and how much of the drive is wanted.

    Attributes:
        arm: Driver's head from the point whose motion is sent, vehicle axes, (3,) [m].
        scale: Share of force and rates that is wanted [-].
    """

    arm: Array
    scale: float


class Intake:
    """Keeps the newest packet and makes one stimulus per planner period."""

    def __init__(self, gain: float = 0.0) -> None:
        self.gain = gain
        self.teleports = 0
        self.clipped = 0
        self._newest: VehicleMotion | None = None
        self._force = np.zeros(3)
        self._rates = np.zeros(3)
        self._spin: Array
        self._used: VehicleMotion | None = None
        self._blanked = False

    @property
    def newest(self) -> VehicleMotion | None:
        """The newest packet taken."""
        return self._newest

    def offer(self, motion: VehicleMotion) -> None:
        """Take a believed packet; the newest wins."""
        last = self._newest
        if motion.mode is DriveMode.TELEPORT or (last is not None and _jumped(last, motion)):
            self.teleports += 1
            self._blanked = True
        self._newest = motion

    def stimulus(self, head: Head, period: float, wanted: bool) -> Stimulus:
        """Make the stimulus of this period.

        Args:
            head: Head point and scale.
            period: Planner period [s].
            wanted: True while the platform runs and the source is fresh.

        Returns:
            The stimulus, faded; STILL before the first packet.
        """
        motion = self._newest
        if motion is None:
            return STILL
        if motion is not self._used:
            self._spin = self._spin_of(motion, period)
            self._used = motion
        drives = wanted and motion.mode is DriveMode.DRIVE and not self._blanked
        target = 1.0 if drives else 0.0
        step = period / (FADE_IN if target > self.gain else FADE_OUT)
        self.gain += float(np.clip(target - self.gain, -step, step))
        if self._blanked:
            # hold what was felt before the jump until it has faded, then begin anew
            if self.gain <= 0.0:
                self._blanked = False
                self._spin = np.zeros(3)
                self._force, self._rates = self._wish(motion, head)
        elif motion.mode is DriveMode.DRIVE:
            force, rates = self._wish(motion, head)
            reach = SLEW * period
            self._force = self._force + np.clip(force - self._force, -reach, reach)
            self._rates = rates
        share = self.gain * head.scale
        return Stimulus(
            frozen(share * self._force),
            frozen(share * self._rates),
            self.gain,
            None if self._blanked else _scaled(motion.preview, head, share),
            share,
            motion.speed,
            motion.driver,
        )

    def _spin_of(self, motion: VehicleMotion, period: float) -> Array:
        """Rates' derivative from the packet used before to this one, (3,) [rad/s2]."""
        if self._used is None or self._used.mode is not DriveMode.DRIVE:
            return np.zeros(3)
        # packets are read once per period, so closer ones arrived a period apart at least
        elapsed = max(period, (motion.arrival_ns - self._used.arrival_ns) * 1e-9)
        return np.asarray((motion.rates - self._used.rates) / elapsed)

    def _wish(self, motion: VehicleMotion, head: Head) -> tuple[Array, Array]:
        force = transfer(motion.force, motion.rates, self._spin, head.arm)
        wish = np.clip(force - _UP, -FORCE_MAX, FORCE_MAX)
        rates = np.clip(motion.rates, -RATE_MAX, RATE_MAX)
        self.clipped += int((wish != force - _UP).any() or (rates != motion.rates).any())
        return wish, rates


def _jumped(last: VehicleMotion, now: VehicleMotion) -> bool:
    elapsed = max(0, now.arrival_ns - last.arrival_ns) * 1e-9
    return abs(now.speed - last.speed) > FORCE_MAX * elapsed + JUMP


def _scaled(preview: Preview | None, head: Head, share: float) -> Preview | None:
    if preview is None:
        return None
    spin = np.zeros_like(preview.rates)
    if len(preview.times) > 1:
        spin = np.gradient(preview.rates, preview.times, axis=0)
    force = transfer(preview.force, preview.rates, spin, head.arm)
    wish = np.clip(force - _UP, -FORCE_MAX, FORCE_MAX)
    rates = np.clip(preview.rates, -RATE_MAX, RATE_MAX)
    return replace(preview, force=frozen(share * wish), rates=frozen(share * rates))
