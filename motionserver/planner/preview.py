"""Previews that come by a way of their own, beside the packets that drive."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from motionserver.core.axes import frozen
from motionserver.core.intake.freshness import SECOND_NS
from motionserver.core.intake.gate import Gate
from motionserver.core.state import Preview, VehicleMotion

KEPT_NS: Final = 2 * SECOND_NS
"""A preview older than this is not handed on any more; it has faded out long before [ns]."""


class PreviewInlet:
    """Keeps the newest preview and gives it to the packets that bring none.

    The table of times is made once for each preview: whoever gets the same table again knows that
    the preview is no newer than before (see `cueing.preview`).
    """

    def __init__(self) -> None:
        self.gate = Gate()
        self._newest: VehicleMotion | None = None
        self._shifted: Preview | None = None

    def offer(self, source: str, address: str, motion: VehicleMotion) -> str | None:
        """Judge and take a packet of the preview's own way.

        Returns:
            None if it is believed, else the name of the counter of the refusal: those of
            `Gate.refuse`, or "no-preview".
        """
        if motion.preview is None:
            return "no-preview"
        refusal = self.gate.refuse(source, address, motion)
        if refusal is None:
            self._newest, self._shifted = motion, None
        return refusal

    def attach(self, motion: VehicleMotion) -> VehicleMotion:
        """Give a packet of the vehicle the newest preview; its own one is newer, and stays."""
        newest = self._newest
        if motion.preview is not None:
            # from now on older than what is known
            self._newest = None
            return motion
        if newest is None or newest.preview is None:
            return motion
        elapsed = motion.arrival_ns - newest.arrival_ns
        if elapsed > KEPT_NS:
            self._newest = None
            return motion
        if self._shifted is None:
            preview = newest.preview
            self._shifted = replace(preview, times=frozen(preview.times - elapsed / SECOND_NS))
        return replace(motion, preview=self._shifted)
