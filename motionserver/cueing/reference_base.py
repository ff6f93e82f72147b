"""What a reference model is: the newest stimulus in, six signals over the horizon out."""

from __future__ import annotations

from typing import Final, Protocol

import numpy as np

from motionserver.core.axes import Array
from motionserver.core.state import Stimulus

HEAVE_FADE: Final = 0.2
"""A vertical acceleration that lasts cannot be followed; believing in it does harm [s]."""
RATE_FADE: Final = 1.0
"""Time constant of body rates [s]."""
SMALLEST_SHARE: Final = 0.05
"""Below this share of the vehicle's motion nothing is learnt of it, nor known about it [-]."""


class AxisModel(Protocol):
    """One reference model. Holds its own history; is asked once in every planner period.

    Attributes:
        status: A few words on what it rests on now, for people.
    """

    status: str

    def predict(self, stimulus: Stimulus, turning: Array) -> Array:
        """Take in the newest stimulus and look ahead.

        Args:
            stimulus: Finite and within bounds, see `reference.believable`.
            turning: How the vehicle turns, scaled alike, where the stimulus holds only the part
                of its rates that is to be shown, (3,) [rad/s].

        Returns:
            Specific force minus g e_z (3), body rates (3) at the model's instants, (K, 6)
            [m/s2, rad/s]; the caller may write into it.
        """
        ...


class Decay:
    """Every signal as it is now, times an exponential of its own.

    Args:
        instants: Instants from now, (K,) [s].
        force: Time constant of surge and sway [s]; infinite = they stay.
    """

    def __init__(self, instants: Array, force: float = np.inf) -> None:
        scales = np.array([force, force, HEAVE_FADE, RATE_FADE, RATE_FADE, RATE_FADE])
        self._decay: Array = np.exp(-instants[:, None] / scales)

    def of(self, stimulus: Stimulus) -> Array:
        """The six signals ahead, (K, 6)."""
        now = np.concatenate((stimulus.force, stimulus.rates))
        out: Array = now * self._decay
        return out
