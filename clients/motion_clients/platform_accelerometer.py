"""What an accelerometer and a gyroscope bolted to the platform read, from how the legs move."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

from .hexapod_legs import (
    HexapodGeometry,
    PoseNotFoundError,
    Six,
    Vector3,
    to_platform_axes,
)

GRAVITY = 9.80665
"""Standard gravity [m/s²]."""

SendForce = Callable[[float, Vector3, Vector3], None]
"""Takes instant [s], specific force [m/s²] and angular velocity [rad/s], platform axes."""


class PlatformAccelerometer:
    """Specific force and rates at the motion reference point, with seeded white noise.

    Give its :meth:`on_step` to a device; it calls ``send_force`` at its own rate.
    """

    def __init__(
        self,
        geometry: HexapodGeometry,
        send_force: SendForce,
        *,
        pose: Six,
        period: float = 0.01,
        force_noise: float = 0.05,
        rate_noise: float = 0.002,
        seed: int = 0,
    ) -> None:
        """A sensor on a platform that stands.

        Args:
            geometry: Joints and legs.
            send_force: Where the readings go.
            pose: Where the platform stands, (6,) [m, rad].
            period: Time between two readings [s].
            force_noise: Standard deviation of the specific force, each axis [m/s²].
            rate_noise: Standard deviation of the rates, each axis [rad/s].
            seed: Of the noise.
        """
        self._geometry = geometry
        self._send_force = send_force
        self._pose = pose
        self._period = period
        self._noise = (force_noise, rate_noise)
        self._random = Random(seed)
        self._due: float | None = None
        self._last: tuple[float, Vector3] | None = None

    def on_step(self, now: float, extensions: Six, speeds: Six) -> None:
        """See the legs at ``now`` [s]: extensions [m] and speeds [m/s], six each."""
        if self._due is not None and now < self._due - 1e-9:
            return
        self._due = now + self._period if self._due is None else self._due + self._period
        try:
            self._pose = self._geometry.pose(extensions, self._pose)
            velocity, spin = self._geometry.twist(self._pose, speeds)
        except PoseNotFoundError:
            self._last = None  # jammed legs contradict each other; no reading then
            return
        if self._last is not None:
            then, before = self._last
            x, y, z = (
                (new - old) / (now - then) for new, old in zip(velocity, before, strict=True)
            )
            force = to_platform_axes(self._pose, (x, y, z + GRAVITY))
            rates = to_platform_axes(self._pose, spin)
            self._send_force(now, self._blur(force, 0), self._blur(rates, 1))
        self._last = now, velocity

    def _blur(self, v: Vector3, kind: int) -> Vector3:
        gauss, deviation = self._random.gauss, self._noise[kind]
        return (v[0] + gauss(0, deviation), v[1] + gauss(0, deviation), v[2] + gauss(0, deviation))
