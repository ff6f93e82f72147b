"""Are units and signs right? What looks like no vehicle keeps a drive from beginning."""

from __future__ import annotations

from collections import deque
from statistics import median
from typing import Final

import numpy as np

from motionserver.core.axes import GRAVITY
from motionserver.core.intake.agreement import Agreement
from motionserver.core.intake.freshness import MS, SECOND_NS
from motionserver.core.intake.standstill import StandstillForce
from motionserver.core.state import VehicleMotion

SPAN: Final = 10
"""Length of what is judged [s]."""
LEAST: Final = 5
"""Less than this is not judged [s]."""
FORCE: Final = (0.4 * GRAVITY, 3.0 * GRAVITY)
"""Median specific force of what stays on the ground, gravity included [m/s2]."""
RATE: Final = 3.0
"""Greatest median body rate of what carries people [rad/s]."""
_EVERY_NS: Final = 100 * MS


class Plausibility:
    """What the owner told in the last seconds: at standstill, in the median, against itself."""

    def __init__(self) -> None:
        self._seen: deque[tuple[int, float, float]] = deque(maxlen=SPAN * SECOND_NS // _EVERY_NS)
        self._standstill = StandstillForce()
        self._agreement = Agreement()

    def heard(self, motion: VehicleMotion) -> None:
        """Note a packet; ten a second are enough."""
        self._standstill.heard(motion)
        self._agreement.heard(motion)
        now = motion.arrival_ns
        if self._seen and now - self._seen[-1][0] < _EVERY_NS:
            return
        force, rate = np.linalg.norm(motion.force), np.linalg.norm(motion.rates)
        self._seen.append((now, float(force), float(rate)))

    def complaint(self) -> str:
        """What is wrong, and what it may be; empty if nothing is, or too little was heard."""
        return self._standstill.complaint or self._of_medians() or self._agreement.complaint

    def _of_medians(self) -> str | None:
        if len(self._seen) < LEAST * SECOND_NS // _EVERY_NS:
            return None
        force = median(one[1] for one in self._seen)
        rate = median(one[2] for one in self._seen)
        if not FORCE[0] <= force <= FORCE[1]:
            return (
                f"the specific force is {force:.2f} m/s2 in the median of {SPAN} s, a vehicle has "
                f"{FORCE[0]:.0f} to {FORCE[1]:.0f}: is it in m/s2, and is the gravity flag true?"
            )
        if rate > RATE:
            return (
                f"the body rate is {rate:.1f} rad/s in the median of {SPAN} s, a vehicle has less "
                f"than {RATE:.0f}: is it sent in rad/s?"
            )
        return None
