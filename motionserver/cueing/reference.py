"""What will be wanted over the horizon: the reference model (Thoendel 2014, equation 9, and more).

Six signals: specific force minus g e_z (3), body rates (3). One class per model; a preview is
blended into whichever of them is in force.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import isfinite
from typing import Final

import numpy as np

from motionserver.core.axes import Array
from motionserver.core.state import Driver, Stimulus
from motionserver.cueing.predictor import PredictorError, chosen
from motionserver.cueing.preview import PreviewKeeper
from motionserver.cueing.reference_ar import Autoregressive
from motionserver.cueing.reference_base import AxisModel
from motionserver.cueing.reference_learned import Learned
from motionserver.cueing.reference_simple import Constant, Fade
from motionserver.cueing.reference_vehicle import Vehicle
from motionserver.errors import TunableError

LARGEST_FORCE: Final = 50.0
"""More than this is believed of no stimulus [m/s2]."""
LARGEST_RATE: Final = 10.0
"""The same of body rates [rad/s]."""
LARGEST_SPEED: Final = 150.0
"""The same of speed [m/s]."""
LARGEST_STEERING: Final = 20.0
"""The same of the steering wheel's angle [rad]."""

_MAKERS: Final[dict[str, Callable[[float, Array, str], AxisModel]]] = {
    "constant": lambda period, instants, predictor: Constant(instants),
    "fade": lambda period, instants, predictor: Fade(instants),
    "ar": lambda period, instants, predictor: Autoregressive(period, instants),
    "vehicle": lambda period, instants, predictor: Vehicle(period, instants),
    "learned": lambda period, instants, predictor: Learned(period, instants, chosen(predictor)),
}
MODELS: Final = tuple(_MAKERS)


def believable(stimulus: Stimulus) -> Stimulus | None:
    """The stimulus within bounds, a preview with holes left out; None if it is not a number.

    Filters remember: one wild number would be felt for seconds.
    """
    if not (np.isfinite(stimulus.force).all() and np.isfinite(stimulus.rates).all()):
        return None
    preview = stimulus.preview
    if preview is not None:
        tables = (preview.times, preview.force, preview.rates)
        if not all(np.isfinite(table).all() for table in tables):
            preview = None
    return replace(
        stimulus,
        force=np.clip(stimulus.force, -LARGEST_FORCE, LARGEST_FORCE),
        rates=np.clip(stimulus.rates, -LARGEST_RATE, LARGEST_RATE),
        preview=preview,
        share=min(max(stimulus.share, 0.0), 1.0) if isfinite(stimulus.share) else 0.0,
        speed=_within(stimulus.speed, LARGEST_SPEED),
        driver=None if stimulus.driver is None else _believable_driver(stimulus.driver),
    )


def _within(value: float, bound: float) -> float:
    return min(max(value, -bound), bound) if isfinite(value) else 0.0


def _believable_driver(told: Driver) -> Driver | None:
    if not all(map(isfinite, (told.throttle, told.brake, told.clutch, told.steering))):
        return None
    throttle, brake, clutch = (
        min(max(pedal, 0.0), 1.0) for pedal in (told.throttle, told.brake, told.clutch)
    )
    return Driver(throttle, brake, clutch, _within(told.steering, LARGEST_STEERING), told.gear)


class Reference:
    """Turns the newest stimulus into six signals at the nodes of the horizon.

    Args:
        model: Model of surge and sway: one of `MODELS`.
        period: Time between two stimuli [s].
        times: Instants after the hand-over that are asked for, (K,) [s].
        lead: From the newest stimulus to the hand-over [s].
        predictor: File of the fitted predictor that "learned" uses.

    Raises:
        ValueError: The model or the predictor does not exist.
    """

    def __init__(
        self, model: str, period: float, times: Array, lead: float, predictor: str = ""
    ) -> None:
        if model not in _MAKERS:
            raise TunableError(
                "reference", f"reference model {model!r} does not exist", ", ".join(MODELS)
            )
        self.model, self.predictor = model, predictor
        self._lead = lead
        instants = times + lead
        try:
            self._axes = _MAKERS[model](period, instants, predictor)
        except PredictorError as error:
            allowed = "a file that 'motionserver tune --predictor NAME' wrote, with its whole path"
            raise TunableError("predictor", str(error), allowed) from error
        self._preview = PreviewKeeper(period, instants)

    def predict(self, stimulus: Stimulus, turning: Array | None = None) -> Array:
        """Take in the newest stimulus and look ahead: (K, 6) [m/s2, rad/s].

        To be called once in every period with what `believable` let through: the models count
        time by these calls.

        Args:
            stimulus: What should be felt now.
            turning: How the vehicle turns, (3,) [rad/s], if the stimulus holds only a part of it
                (high-passed, say); models of the vehicle learn from this.
        """
        rates = stimulus.rates if turning is None else turning
        return self._preview.blend(self._axes.predict(stimulus, rates), stimulus)

    @property
    def known(self) -> float:
        """How far after the hand-over a preview tells the future rather than a model [s].

        0 while its weight is not whole.
        """
        return max(0.0, self._preview.end - self._lead) if self._preview.weight >= 1.0 else 0.0

    def describe(self) -> str:
        """What the forecast rests on now, in a few words for people."""
        weight = self._preview.weight
        if weight <= 0.0:
            return self._axes.status
        if weight >= 1.0:
            return f"preview, then {self._axes.status}"
        return f"preview {100.0 * weight:.0f} %, then {self._axes.status}"
