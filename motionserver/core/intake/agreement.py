"""Two things that must agree: rates and attitude, speed and acceleration, preview and cue.

Each pair is compared over half a second at a time, over the last seconds. Only a gross
disagreement is named: a factor that a wrong unit makes, or a sign that is always the opposite.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from math import cos, sin, tan
from typing import Final

import numpy as np

from motionserver.core.intake.freshness import MS
from motionserver.core.kinematics.rotation import gravity_in_body
from motionserver.core.state import DriveMode, VehicleMotion

STEP_NS: Final = 500 * MS
"""Length of one comparison [ns]."""
KEPT: Final = 20
"""Comparisons that are judged together."""
FEWEST: Final = 8
"""Fewer are not judged."""
FACTOR: Final = 3.0
"""Ratio of two things that should be equal beyond which a unit must be wrong [-]."""
OPPOSITE: Final = -0.7
"""Correlation of two things that should be equal below which a sign must be wrong [-].

Recorded drives of trucks, a racing car that spins and an aircraft never fall below 0."""
ALIKE: Final = 0.9
"""Correlation from which two things differ by a factor only [-]."""
FASTER: Final = 5.0
"""Speed above which speed and acceleration are compared: nobody reverses at it [m/s]."""
_GAP_NS: Final = 200 * MS
_STEEP: Final = 1.47
"""Pitch beyond which angles are not integrated: roll is hardly known there [rad]."""


@dataclass(frozen=True, slots=True)
class _Pair:
    """What is compared, how large it must be to tell something, what to say."""

    first: str
    second: str
    least: float
    unit: str
    remedy: str


_PAIRS: Final = (
    _Pair("roll", "the roll rate", 0.03, "rad", "roll and p are in rad, positive left side up"),
    _Pair("pitch", "the pitch rate", 0.03, "rad", "pitch and q are in rad, positive nose down"),
    _Pair("speed", "the forward acceleration", 0.5, "m/s", "x is forward, in m/s and m/s2"),
    _Pair(
        "speed times yaw rate", "the lateral acceleration", 0.5, "m/s",
        "y is to the left, in m/s2, and the yaw rate positive to the left, in rad/s",
    ),
)  # fmt: skip


class Agreement:
    """Compares what one owner tells.

    Attributes:
        complaint: The disagreement that was found, with the remedy; empty without one.
    """

    def __init__(self) -> None:
        """Begin without a packet."""
        self.complaint = ""
        self._sums: _Sums | None = None
        self._found: list[deque[tuple[float, float]]] = [deque(maxlen=KEPT) for _ in _PAIRS]
        self._preview = PreviewAgreement()

    def heard(self, motion: VehicleMotion) -> None:
        """Note a packet."""
        self._preview.heard(motion)
        sums = self._sums
        if sums is None or not _goes_on(sums.last, motion):
            self._sums = _Sums(motion)
            return
        sums.add(motion)
        if motion.arrival_ns - sums.begin_ns >= STEP_NS:
            for found, both, usable in zip(self._found, sums.both, sums.usable, strict=True):
                if usable:
                    found.append((float(both[0]), float(both[1])))
            self._sums = _Sums(motion)
            said = (_judged(*one) for one in zip(_PAIRS, self._found, strict=True))
            self.complaint = next(filter(None, said), "") or self._preview.complaint


class _Sums:
    """What both of each pair gained since a packet.

    Attributes:
        last: The newest packet.
        begin_ns: Arrival of the first one [ns].
        both: The sums, one row per pair.
        usable: Which pairs could be compared all the time.
    """

    def __init__(self, first: VehicleMotion) -> None:
        self.last, self.begin_ns = first, first.arrival_ns
        self.both = np.zeros((len(_PAIRS), 2))
        self.usable = np.ones(len(_PAIRS), bool)

    def add(self, motion: VehicleMotion) -> None:
        """Add what was gained between the newest packet and this one."""
        last, self.last = self.last, motion
        elapsed = (motion.arrival_ns - last.arrival_ns) * 1e-9
        p, q, r = (0.5 * (last.rates + motion.rates)).tolist()
        gravity = None
        if last.attitude is None or motion.attitude is None or abs(motion.attitude[1]) > _STEEP:
            self.usable[:2] = False
        else:
            roll, pitch = motion.attitude
            turned = q * sin(roll) + r * cos(roll)
            moved = (roll - last.attitude[0], pitch - last.attitude[1])
            rates = (p + tan(pitch) * turned, q * cos(roll) - r * sin(roll))
            self.both[:2] += np.array((moved, np.multiply(rates, elapsed))).T
            gravity = gravity_in_body(np.array(roll), np.array(pitch))
        if gravity is None or not motion.speed_known or motion.speed < FASTER:
            # what the force says of the acceleration hangs on the slope
            self.usable[2:] = False
            return
        forward, left, _ = ((motion.force - gravity) * elapsed).tolist()
        self.both[2] += (motion.speed - last.speed, forward)
        self.both[3] += (motion.speed * r * elapsed, left)


def _goes_on(last: VehicleMotion, motion: VehicleMotion) -> bool:
    both_drive = last.mode is DriveMode.DRIVE and motion.mode is DriveMode.DRIVE
    return both_drive and motion.arrival_ns - last.arrival_ns < _GAP_NS


def _judged(pair: _Pair, found: deque[tuple[float, float]]) -> str | None:
    if len(found) < FEWEST:
        return None
    first, second = np.array(found).T
    sizes = np.sqrt(np.mean(first**2)), np.sqrt(np.mean(second**2))
    large, small = max(sizes), min(sizes)
    if large < pair.least or small < 1e-3 * large:
        # too little to tell, or one of the two is not told at all
        return None
    like = float(np.mean(first * second)) / float(large * small)
    if like <= OPPOSITE:
        return (
            f"{pair.first} and {pair.second} disagree, when one rises the other falls: a sign is "
            f"wrong ({pair.remedy})"
        )
    if like > ALIKE and large > FACTOR * small:
        return (
            f"{pair.first} and {pair.second} disagree by a factor of {large / small:.1f} "
            f"({sizes[0]:.2g} and {sizes[1]:.2g} {pair.unit} in half a second): a unit is wrong "
            f"({pair.remedy})"
        )
    return None


PREVIEW_APART: Final = 4.0
"""Median difference between a preview's first sample and the cue that is no forecast [m/s2]."""
PREVIEW_NEAR: Final = 0.2
"""How far ahead a first sample may lie to be compared [s]."""


class PreviewAgreement:
    """A preview's first sample against the cue it came with.

    Attributes:
        complaint: Why they cannot belong together; empty if they can.
    """

    def __init__(self) -> None:
        """Begin without a packet."""
        self.complaint = ""
        self._apart: deque[float] = deque(maxlen=KEPT)
        self._noted_ns: int | None = None

    def heard(self, motion: VehicleMotion) -> None:
        """Note a packet; ten a second are enough."""
        preview = motion.preview
        if preview is None or preview.times[0] > PREVIEW_NEAR:
            return
        now = motion.arrival_ns
        if self._noted_ns is not None and now - self._noted_ns < 100 * MS:
            return
        self._noted_ns = now
        self._apart.append(float(np.linalg.norm(preview.force[0] - motion.force)))
        middle = float(np.median(self._apart))
        bad = len(self._apart) >= FEWEST and middle > PREVIEW_APART
        self.complaint = (
            f"the preview's first sample is {middle:.1f} m/s2 from the cue in the median: both "
            f"need the same axes, unit and gravity flag"
            if bad
            else ""
        )
