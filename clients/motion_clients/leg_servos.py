"""Six leg drives: they follow setpoints within speed, acceleration and stroke."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import copysign, sqrt

from .hexapod_legs import Six

_POSITION_GAIN = 20.0  # [1/s]; with the next, a critically damped drive of 40 rad/s
_SPEED_GAIN = 80.0  # [1/s]
_REST_SPEED = 1e-4  # [m/s]
_ARRIVED = 1e-5  # [m]


@dataclass(frozen=True, slots=True)
class _Path:
    """From where to where the setpoints run, and how: linearly, or from rest to rest."""

    start: Six
    end: Six
    duration: float
    is_smooth: bool

    def at(self, elapsed: float) -> tuple[float, float]:
        """Fraction of the way, and its rate [1/s]."""
        u = elapsed / self.duration
        if u >= 1.0:
            return 1.0, 0.0
        if not self.is_smooth:
            return u, 1.0 / self.duration
        return u**3 * (10 - 15 * u + 6 * u * u), 30 * (u * (1 - u)) ** 2 / self.duration


class LegServos:
    """Positions and speeds of six legs under their drives.

    Attributes:
        extensions: Present leg extensions, six [m].
        speeds: Present leg speeds, six [m/s].
        stuck: Legs that do not move whatever the drive does.
    """

    def __init__(
        self, extensions: Sequence[float], *, stroke: float, speed: float, acceleration: float
    ) -> None:
        """Legs at rest.

        Args:
            extensions: Where they stand, six [m].
            stroke: Mechanical stop; the other is 0 [m].
            speed: Greatest leg speed [m/s].
            acceleration: Greatest leg acceleration [m/s²].
        """
        self.extensions = list(extensions)
        self.speeds = [0.0] * 6
        self.stuck: set[int] = set()
        self._stroke = stroke
        self._speed = speed
        self._acceleration = acceleration
        self._path: _Path | None = None
        self._elapsed = 0.0

    @property
    def target(self) -> Six:
        """Where the legs were last told to go; where they are, if they brake [m]."""
        return tuple(self.extensions) if self._path is None else self._path.end

    @property
    def is_at_rest(self) -> bool:
        """Whether no leg moves and none is about to."""
        return self.has_arrived and all(abs(v) < _REST_SPEED for v in self.speeds)

    @property
    def has_arrived(self) -> bool:
        """Whether the setpoints have come to their end and every free leg with them."""
        if self._path is None:
            return True
        return self._elapsed >= self._path.duration and all(
            i in self.stuck or abs(x - end) < _ARRIVED
            for i, (x, end) in enumerate(zip(self.extensions, self._path.end, strict=True))
        )

    def brake(self) -> None:
        """Stop as fast as the legs may, wherever that is."""
        self._path = None

    def follow(self, target: Sequence[float], duration: float) -> None:
        """Run the setpoints linearly to ``target`` [m] within ``duration`` [s]."""
        self._start(_Path(self._setpoints()[0], tuple(target), duration, is_smooth=False))

    def move(self, target: Sequence[float], duration: float) -> None:
        """Run the setpoints from rest to rest at ``target`` [m] within ``duration`` [s]."""
        self._start(_Path(tuple(self.extensions), tuple(target), duration, is_smooth=True))

    def move_gently(self, target: Sequence[float], speed: float, acceleration: float) -> None:
        """Run from rest to rest at ``target`` [m], no leg faster than told [m/s, m/s²]."""
        way = max(abs(b - a) for a, b in zip(self.extensions, target, strict=True))
        # A quintic from rest to rest peaks at 15/8 way/T and at 5.7735 way/T².
        self.move(target, max(0.1, 1.875 * way / speed, sqrt(5.7735 * way / acceleration)))

    def step(self, dt: float) -> None:
        """Let ``dt`` seconds pass; explicit Euler, meant for steps of a few milliseconds."""
        self._elapsed += dt
        setpoints, rates = self._setpoints()
        for i in range(6):
            if i in self.stuck:
                self.speeds[i] = 0.0
                continue
            speed = self._wanted_speed(setpoints[i] - self.extensions[i], rates[i])
            limit = self._acceleration * dt
            change = (speed - self.speeds[i]) * (_SPEED_GAIN * dt if self._path else 1.0)
            self.speeds[i] += max(-limit, min(limit, change))
            self.extensions[i] += self.speeds[i] * dt
            if not 0.0 <= self.extensions[i] <= self._stroke:
                self.extensions[i] = max(0.0, min(self._stroke, self.extensions[i]))
                self.speeds[i] = 0.0

    def _wanted_speed(self, error: float, rate: float) -> float:
        if self._path is None:
            return 0.0
        # The root is the speed from which the leg can still stop within the error.
        reach = sqrt(1.6 * self._acceleration * abs(error))
        wanted = rate + copysign(min(_POSITION_GAIN * abs(error), reach), error)
        return max(-self._speed, min(self._speed, wanted))

    def _setpoints(self) -> tuple[Six, Six]:
        if self._path is None:
            return tuple(self.extensions), (0.0,) * 6
        part, rate = self._path.at(self._elapsed)
        ways = [(a, b - a) for a, b in zip(self._path.start, self._path.end, strict=True)]
        return tuple(a + part * way for a, way in ways), tuple(rate * way for _, way in ways)

    def _start(self, path: _Path) -> None:
        self._path = path
        self._elapsed = 0.0
