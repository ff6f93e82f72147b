"""The guard's own plans: a rest where the platform stands, and the straight move to neutral."""

from __future__ import annotations

from typing import Final

import numpy as np

from motionserver.core.axes import Array, frozen
from motionserver.core.kinematics.forward import NoPoseError, forward
from motionserver.core.limits import Machine
from motionserver.core.motion.player import Playback, follow
from motionserver.core.safety.accept import accept_move, accept_rest
from motionserver.core.safety.record import GuardRecord
from motionserver.core.safety.verdict import Rejection
from motionserver.core.safety.watchdog import DeviceWatch

NEUTRAL: Final = frozen(np.zeros(6))
REACH: Final = 0.005
"""How far the first setpoint after a restart may differ from the measured legs [m]."""


class OwnMoves:
    """Makes the plans that no planner is needed for; each is verified as any other.

    Args:
        machine: Geometry and hard limits.
        record: The guard's state; what is made is played in it.
        device: Where the platform is measured; its tracking begins anew with every rest.
        homes: Poses (H, 6) that must be reachable straight from a rest.
    """

    def __init__(
        self, machine: Machine, record: GuardRecord, device: DeviceWatch, homes: Array
    ) -> None:
        self.machine, self.homes = machine, homes
        self._record, self._device = record, device

    def start_at(self, pose: Array, homes: Array) -> str:
        """Rest at ``pose`` (6,) from now on; what forbids it, empty if nothing does."""
        record = self._record
        accepted = accept_rest(self.machine, pose, record.take_id(), homes, REACH)
        self._device.forgive()
        if isinstance(accepted, Rejection):
            return f"cannot stand here: {accepted}"
        record.playback = Playback(accepted, accepted.plan.duration)
        return ""

    def start_from_measured(self) -> str:
        """Rest where the platform is measured; what forbids it, empty if nothing does."""
        # what was played before its fault is not where it is now, also if it cannot be told where
        self._record.playback = None
        newest = self._device.newest
        assert newest is not None
        # wherever the platform stands, the way home leads over neutral: no other need be straight
        over = self.homes[:1]
        try:
            if newest.pose is not None:
                return self.start_at(newest.pose, over)
            if newest.legs is not None:
                return self.start_at(forward(self.machine, newest.legs), over)
        except NoPoseError as error:
            return str(error)
        return "the device measures neither legs nor pose"

    def homeward(self, playback: Playback) -> Playback | str:
        """Follow a playback that rests by the straight move to neutral; what forbids it."""
        if ends_at_neutral(playback):
            return playback
        move = accept_move(
            self.machine,
            playback.playing,
            playback.clock,
            NEUTRAL,
            self._record.take_id(),
            self.homes,
        )
        return f"no way home: {move}" if isinstance(move, Rejection) else follow(playback, move)


def ends_at_neutral(playback: Playback) -> bool:
    """True if what is played ends at neutral."""
    return not np.any(playback.playing.plan.rest_pose)
