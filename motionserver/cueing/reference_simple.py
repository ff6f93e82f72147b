"""Reference models without memory: what is stays, or fades (Thoendel 2014, equation 9)."""

from __future__ import annotations

from typing import Final

import numpy as np

from motionserver.core.axes import Array
from motionserver.core.state import Stimulus
from motionserver.cueing.reference_base import Decay

FORCE_FADE: Final = 1.0
"""Time constant of the "fade" model in surge and sway [s]."""


class Constant:
    """Surge and sway stay as they are: the paper's equation 9."""

    def __init__(self, instants: Array, force_fade: float = np.inf) -> None:
        self.status = "constant"
        self._decay = Decay(instants, force_fade)

    def predict(self, stimulus: Stimulus, turning: Array) -> Array:
        """Look ahead; see `AxisModel.predict`."""
        return self._decay.of(stimulus)


class Fade(Constant):
    """Surge and sway go to zero with one time constant."""

    def __init__(self, instants: Array) -> None:
        super().__init__(instants, FORCE_FADE)
        self.status = "fade"
