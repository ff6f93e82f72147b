"""Commands judged in wall time: how close they follow each other, and what that asks of a leg.

A base takes one word per frame. Two commands within a frame hide one of them, and a whole step in
less than a period is a faster leg than the step says: judging in send order alone sees neither.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from .hexapod_legs import Six
from .moog_judged import JudgedLimits

_RESOLUTION = 1e-6  # [s]: closer arrivals are divided by this
_STEP_TOLERANCE = 1e-5  # [m]: a smaller step is none
_SPEED_TOLERANCE = 2e-5  # [m/s]: float32 words differenced at 60 Hz err by up to 4e-6


@dataclass(slots=True)
class WallTimeMonitor:
    """Smallest spacing and largest leg speeds by the instants of arrival.

    Attributes:
        limits: What is judged; nothing is where the wire may lose or delay commands, or where the
            instants are not exact.
        spacing: Smallest time between two commands [s]; None before the second.
        too_close: Commands closer to the one before than a host may send them.
        hidden_steps: Steps that such a command may have hidden from a base that reads once a frame.
        speeds: Largest leg speeds, six [m/s].
        too_fast: Steps too fast for their time though not for a whole period, by leg.
    """

    limits: JudgedLimits
    spacing: float | None = None
    too_close: int = 0
    hidden_steps: int = 0
    speeds: list[float] = field(default_factory=lambda: [0.0] * 6)
    too_fast: list[int] = field(default_factory=lambda: [0] * 6)

    @property
    def is_judging(self) -> bool:
        """Whether offences count."""
        return self.limits.in_wall_time and not self.limits.may_lose

    @property
    def violations(self) -> int:
        """Offences counted so far."""
        return self.hidden_steps + sum(self.too_fast)

    def on_arrival(self, gap: float) -> None:
        """Take the time since the command before [s]."""
        self.spacing = gap if self.spacing is None else min(self.spacing, gap)
        self.too_close += gap < self.limits.spacing * self.limits.period

    def on_step(self, gap: float, before: Six, after: Six) -> list[tuple[str, int | None, float]]:
        """Take one step of the legs [m] that was commanded ``gap`` seconds after the one before.

        Returns:
            Offences: kind, leg if it is one leg's, spacing [s] or speed [m/s].
        """
        offences: list[tuple[str, int | None, float]] = []
        is_judged = self.is_judging and gap < self.limits.spacing * self.limits.period
        step = max(abs(end - start) for start, end in zip(before, after, strict=True))
        is_hiding = is_judged and gap < self.limits.hiding * self.limits.period
        if is_hiding and step > _STEP_TOLERANCE:
            self.hidden_steps += 1
            offences.append(("spacing", None, gap))
        allowed = self.limits.wall_speed * self.limits.speed + _SPEED_TOLERANCE
        for leg, (start, end) in enumerate(zip(before, after, strict=True)):
            speed = (end - start) / max(gap, _RESOLUTION)
            self.speeds[leg] = max(self.speeds[leg], abs(speed))
            # at a proper spacing the test in send order is the stricter one
            if is_judged and abs(speed) > allowed:
                self.too_fast[leg] += 1
                offences.append(("wall_speed", leg, speed))
        return offences
