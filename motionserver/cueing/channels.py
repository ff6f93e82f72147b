"""The four channels of the washout and how they make up a pose; the one place of the tilt's sign.

The paper writes a = x'' + g phi with one inclination phi (equations 4 and 5). Here roll = +phi
and pitch = -phi, since positive pitch is nose down.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from motionserver.core.axes import Array, Axis
from motionserver.core.state import PlatformState
from motionserver.cueing.filters import Block, FilterSet, channel, high_pass


@dataclass(frozen=True, slots=True)
class Channel:
    """One washout input and the pose coordinates it moves.

    Attributes:
        name: Its name.
        axes: Pose axis of each triple of its state.
        signs: Pose coordinate = sign * state, per triple.
        signal: Which of the six reference signals it follows.
    """

    name: str
    axes: tuple[Axis, ...]
    signs: tuple[float, ...]
    signal: int

    @property
    def size(self) -> int:
        """Number of states."""
        return 3 * len(self.axes)

    def state(self, start: PlatformState) -> Array:
        """State [x, x', x'' (, phi, phi', phi'')] of a platform state, (n,)."""
        out = np.empty(self.size)
        for index, (axis, sign) in enumerate(zip(self.axes, self.signs, strict=True)):
            out[3 * index] = sign * start.pose[axis]
            out[3 * index + 1] = sign * start.velocity[axis]
            out[3 * index + 2] = sign * start.acceleration[axis]
        return out

    def block(self, filters: FilterSet) -> Block:
        """Its plant."""
        if len(self.axes) == 2:
            return channel(filters.high, filters.low)
        return high_pass(filters.heave if self.axes[0] is Axis.HEAVE else filters.yaw)


SURGE: Final = Channel("surge", (Axis.SURGE, Axis.PITCH), (1.0, -1.0), 0)
SWAY: Final = Channel("sway", (Axis.SWAY, Axis.ROLL), (1.0, 1.0), 1)
HEAVE: Final = Channel("heave", (Axis.HEAVE,), (1.0,), 2)
YAW: Final = Channel("yaw", (Axis.YAW,), (1.0,), 5)
CHANNELS: Final = (SURGE, SWAY, HEAVE, YAW)


def minus(state: PlatformState, part: PlatformState) -> PlatformState:
    """What remains of a state without the vehicle's own rotation."""
    return PlatformState(
        state.pose - part.pose,
        state.velocity - part.velocity,
        state.acceleration - part.acceleration,
    )
