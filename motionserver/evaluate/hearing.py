"""What the server hears of a recording, sample by sample, as from a simulator."""

from __future__ import annotations

from collections import Counter
from typing import Final

import numpy as np
from motion_protocol import preview_times

from motionserver.core.axes import Array, frozen
from motionserver.core.intake.freshness import SECOND_NS
from motionserver.core.intake.gate import Gate
from motionserver.core.intake.intake import Intake
from motionserver.core.state import DriveMode, Preview, VehicleMotion
from motionserver.evaluate.recording import Recording

LONGEST_PREVIEW: Final = 4.0
"""A preview further ahead is not told [s]."""
_BLOCK: Final = 512


class Hearing:
    """Offers a recording's samples at their instants.

    Args:
        recording: The drive.
        preview: How far it is told ahead, as closely as one packet carries it [s]; 0 for what its
            sender itself told.
        gate: Believes or refuses.
        intake: Takes what is believed.
        refused: Counts what is not.

    Raises:
        ValueError: The preview is no time from 0 to `LONGEST_PREVIEW`.
    """

    def __init__(
        self,
        recording: Recording,
        preview: float,
        gate: Gate,
        intake: Intake,
        refused: Counter[str],
    ) -> None:
        self._recording, self._gate, self._intake = recording, gate, intake
        self._refused, self._given = refused, 0
        # no more than a packet carries, at the instants that senders choose
        self._steps = np.array(preview_times(preview))
        self._columns = (*recording.force.T, *recording.rates.T)
        self._block: tuple[int, Array, Array, Array] | None = None

    def until(self, now: float) -> None:
        """Offer every sample that has arrived by ``now`` [s]."""
        recording = self._recording
        while self._given < len(recording.times) and recording.times[self._given] <= now + 1e-9:
            given = self._given
            stamp = round(float(recording.times[given]) * SECOND_NS)
            motion = VehicleMotion(
                stamp,
                1,
                given,
                stamp,
                recording.force[given],
                recording.rates[given],
                float(recording.speed[given]),
                mode=DriveMode.DRIVE if recording.modes is None else recording.modes[given],
                preview=self._preview(given) if len(self._steps) else self._recorded(given),
                driver=None if recording.drivers is None else recording.drivers[given],
            )
            refusal = self._gate.refuse("recording", recording.name, motion)
            if refusal is None:
                self._intake.offer(motion)
            else:
                self._refused[refusal] += 1
            self._given += 1

    def _recorded(self, given: int) -> Preview | None:
        """What the sender itself told ahead."""
        previews = self._recording.previews
        return None if previews is None else previews[given]

    def _preview(self, given: int) -> Preview | None:
        """What the recording holds after sample ``given``, as far as it goes."""
        if self._block is None or given >= self._block[0] + _BLOCK:
            self._block = self._look(given)
        first, ahead, force, rates = self._block
        row = given - first
        known = int(np.searchsorted(ahead[row], self._recording.times[-1] + 1e-9, side="right"))
        if known == 0:
            return None
        return Preview(
            frozen(ahead[row, :known] - self._recording.times[given]),
            frozen(force[row, :known]),
            frozen(rates[row, :known]),
        )

    def _look(self, first: int) -> tuple[int, Array, Array, Array]:
        """Previews of the next samples at once: first of them, instants, forces, rates."""
        times = self._recording.times
        ahead = times[first : first + _BLOCK, None] + self._steps
        told = np.stack([np.interp(ahead, times, column) for column in self._columns], axis=2)
        return first, ahead, told[..., :3], told[..., 3:]
