"""A washout without a server: filters and tilt-rate limit alone, many sets at once.

No planner, no latency, no governor: what the filters would do on a platform that follows at once.
Only good for choosing; poses beyond the machine are found and left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from motionserver.core.axes import GRAVITY, Array, frozen
from motionserver.core.kinematics.hexapod import leg_lengths
from motionserver.core.kinematics.rotation import felt
from motionserver.core.limits import Machine
from motionserver.core.plan import Plan
from motionserver.cueing.classical import REID_NAHON, TiltLoop
from motionserver.cueing.filters import Block, FilterSet, discretise, high_pass, rate_high_pass
from motionserver.cueing.tuning import Tuning
from motionserver.evaluate.drive import Drive, assemble, wanted_at
from motionserver.evaluate.metrics.linear import rms
from motionserver.evaluate.recording import Recording

STEP: Final = 0.002
"""Time step of the filters [s]; on a rough road 10 ms would already be felt as lag."""


@dataclass(frozen=True, slots=True)
class Washout:
    """One set of corners with a gain.

    Attributes:
        high: High-pass of surge and sway [rad/s].
        low: Low-pass of tilt coordination [rad/s].
        gain: On top of the scale [-].
    """

    high: float
    low: float
    gain: float

    def filters(self) -> FilterSet:
        """The standard washout with these corners."""
        return replace(
            REID_NAHON,
            name=f"high {self.high:g}, low {self.low:g}",
            high=replace(REID_NAHON.high, omega=self.high),
            low=replace(REID_NAHON.low, omega=self.low),
        )


class Screen:
    """Answers of all sets to one recording.

    Args:
        machine: Geometry, hard limits and head point.
        recording: The drive.
        tuning: Scale, rotation gain, tilt rate.
        highs: High-pass corners [rad/s].
        lows: Low-pass corners [rad/s].
        gains: Gains [-].
    """

    def __init__(
        self,
        machine: Machine,
        recording: Recording,
        tuning: Tuning,
        highs: Sequence[float],
        lows: Sequence[float],
        gains: Sequence[float],
    ) -> None:
        self._machine, self._recording, self._tuning = machine, recording, tuning
        steps = int(np.ceil(recording.duration / STEP - 1e-6))
        self._times = frozen(np.arange(steps + 1) * STEP)
        self._wanted, rates = wanted_at(recording, self._times, tuning.scale, None)
        self._gains = tuple(gains)
        horizontal = [high_pass(Washout(high, 1.0, 1.0).filters().high) for high in highs]
        turn = REID_NAHON.rotation, REID_NAHON.rotation, REID_NAHON.yaw.omega
        blocks = [
            *(block for block in horizontal for _ in range(2)),
            high_pass(REID_NAHON.heave),
            *(rate_high_pass(corner, REID_NAHON.rotation_tau) for corner in turn),
        ]
        share = tuning.rotation_gain
        slow = _slow(rates[:, 2], REID_NAHON.yaw.omega)
        pushes = np.column_stack(
            (
                *(self._wanted[:, axis] for _ in highs for axis in range(2)),
                self._wanted[:, 2],
                share * rates[:, :2],
                rates[:, 2] - slow,
            )
        )
        answers = _linear(blocks, pushes)
        self._flat = {high: answers[:, :, 2 * i : 2 * i + 2] for i, high in enumerate(highs)}
        self._heave, self._turns = answers[:, :, -4], answers[:, :, -3:]
        tilting = self._wanted[:, :2] / GRAVITY
        self._tilts = {low: self._tilt(low, tilting) for low in lows}

    def motion(self, washout: Washout) -> tuple[Array, Array, Array]:
        """Pose, velocity and acceleration of one set on the steps, each (N, 6)."""
        gain = washout.gain
        tables = np.zeros((3, len(self._times), 6))
        tables[..., 0:2] = gain * self._flat[washout.high]
        tables[..., 2] = gain * self._heave
        tables[..., 3:5] = self._turns[..., 0:2]
        tables[..., 5] = gain * self._turns[..., 2]
        tilt = self._tilts[washout.low][:, :, self._gains.index(gain)]
        tables[..., 3] += tilt[..., 1]
        tables[..., 4] -= tilt[..., 0]
        return tables[0], tables[1], tables[2]

    def judge(self, washout: Washout) -> tuple[float, bool]:
        """RMSE of x and y together [m/s2], and whether all legs keep stroke and speed."""
        pose, velocity, acceleration = self.motion(washout)
        force, _ = felt(pose, velocity, acceleration, self._machine.head)
        legs = leg_lengths(self._machine, pose)
        inside = self._machine.leg_min <= legs.min() and legs.max() <= self._machine.leg_max
        slow = np.abs(np.diff(legs, axis=0)).max() <= self._machine.leg_speed * STEP
        return rms(force[:, :2] - self._wanted[:, :2]), bool(inside and slow)

    def drive(self, washout: Washout, rate: float) -> Drive:
        """The same as a drive with samples at ``rate`` [Hz], quintics between the steps."""
        plan = Plan(0, 0, 0.0, self._times, *self.motion(washout))
        count = int(np.floor(self._recording.duration * rate + 1e-6)) + 1
        samples = plan.evaluate(np.minimum(np.arange(count) / rate, self._times[-1]))
        return assemble(
            "hindsight", self._machine, self._recording, rate, samples, self._tuning.scale
        )

    def _tilt(self, low: float, wanted: Array) -> Array:
        """Tilts and their derivatives with every gain: (3, N, gains, 2)."""
        loop = TiltLoop(Washout(1.0, low, 1.0).filters().low, np.array([STEP]))
        asked = np.concatenate([gain * wanted for gain in self._gains], axis=1)
        out = np.zeros((3, len(asked), asked.shape[1]))
        state = out[:, 0]
        for index in range(len(asked) - 1):
            state = loop.run(state, asked[index : index + 1], self._tuning.tilt_rate)[:, 0]
            out[:, index + 1] = state
        return out.reshape(3, len(asked), len(self._gains), 2)


def _linear(blocks: list[Block], pushes: Array) -> Array:
    """States of third-order blocks (M) under inputs (N, M), held on each step: (3, N, M)."""
    pairs = [discretise(block, STEP) for block in blocks]
    carry = np.stack([pair[0] for pair in pairs])
    push = np.stack([pair[1] for pair in pairs])
    out = np.zeros((len(pushes), len(blocks), 3))
    for index in range(len(pushes) - 1):
        state = (carry @ out[index][:, :, None])[:, :, 0]
        out[index + 1] = state + push * pushes[index][:, None]
    return out.transpose(2, 0, 1)


def _slow(rate: Array, omega: float) -> Array:
    """First-order low-pass of a rate (N,), from zero."""
    share = 1.0 - np.exp(-omega * STEP)
    out, value = np.empty(len(rate)), 0.0
    for index, now in enumerate(rate.tolist()):
        value += share * (now - value)
        out[index] = value
    return out
