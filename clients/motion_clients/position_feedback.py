"""What a base reports of its legs: late, and smoothed."""

from __future__ import annotations

from collections import deque

from .hexapod_legs import HexapodGeometry, PoseNotFoundError, Six


class PositionFeedback:
    """Leg extensions behind a first-order lag and a fixed delay, and the pose they make.

    Attributes:
        poses_not_found: How often the reported legs contradicted each other.
    """

    def __init__(
        self, geometry: HexapodGeometry, pose: Six, *, lag: float, delay: float, step: float
    ) -> None:
        """Feedback of a platform that stands.

        Args:
            geometry: Joints and legs.
            pose: Where it stands, (6,) [m, rad].
            lag: Time constant [s].
            delay: Delay behind the lag [s].
            step: Time from one :meth:`update` to the next [s].
        """
        self.poses_not_found = 0
        self._geometry = geometry
        self._pose = pose
        self._share = step / (lag + step)
        self._lagged = geometry.extensions(pose)
        length = round(delay / step) + 1
        self._line: deque[Six] = deque([self._lagged] * length, maxlen=length)

    @property
    def extensions(self) -> Six:
        """Reported leg extensions, six [m]."""
        return self._line[0]

    def update(self, extensions: list[float]) -> None:
        """Take the true extensions [m] of one more step."""
        share = self._share
        self._lagged = tuple(
            old + share * (new - old) for old, new in zip(self._lagged, extensions, strict=True)
        )
        self._line.append(self._lagged)

    def pose(self) -> Six:
        """Reported pose, (6,) [m, rad]; the last one found while the legs contradict each other."""
        try:
            self._pose = self._geometry.pose(self.extensions, self._pose)
        except PoseNotFoundError:
            # A jammed leg can do this; the real base would report nonsense too.
            self.poses_not_found += 1
        return self._pose
