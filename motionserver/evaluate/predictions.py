"""Reference models side by side: how well each foretells a recorded drive.

The figure is that of a forecast, not of a ride: rms of (forecast - what came) over rms of what
came, where "what came" is the mean of the specific force over 0.2 s about that instant (faster
parts cannot be foretold, and the cabin follows them anyway). 0 = foretold, 1 = as good as
expecting nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from motionserver.core.axes import GRAVITY, Array, frozen
from motionserver.core.state import Driver, Stimulus
from motionserver.cueing.predictor import Predictor
from motionserver.cueing.reference import MODELS, Reference
from motionserver.cueing.reference_learned import Learned
from motionserver.evaluate.progress import Share
from motionserver.evaluate.recording import Recording, from_samples

HORIZONS: Final = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0)
"""How far ahead the figures are told [s]."""
UNFITTED: Final = tuple(name for name in MODELS if name != "learned")
"""Models that need no file of one's own."""
PERIOD: Final = 0.01
"""Planner period of the comparison [s]."""
WINDOW: Final = 0.2
"""Mean over which what came is judged [s]."""
SETTLE: Final = 3.0
"""Left out at the beginning, while models learn [s]."""
QUIET: Final = 0.02
"""An axis with less than this is not judged: there is nothing to foretell [m/s2]."""
_SECOND: Final = round(1.0 / PERIOD)
Forecaster = Callable[[Stimulus], Array]
"""Newest stimulus -> surge and sway at the horizons, (K, 2) or wider."""


@dataclass(frozen=True, slots=True)
class PredictionErrors:
    """Relative errors of several models on one recording.

    Attributes:
        recording: Its name.
        horizons: (K,) [s].
        models: Names, in the order of the rows.
        errors: (models, 2, K); surge, sway; NaN where there is nothing to foretell.
    """

    recording: str
    horizons: tuple[float, ...]
    models: tuple[str, ...]
    errors: Array


def predictions(
    recording: Recording,
    models: Sequence[str] = UNFITTED,
    *,
    predictor: str = "",
    scale: float = 1.0,
    drivers: Sequence[Driver | None] | None = None,
    horizons: Sequence[float] = HORIZONS,
    progress: Callable[[str, float], None] | None = None,
) -> PredictionErrors:
    """Forecast a recording with every model and compare.

    Args:
        recording: The drive.
        models: Names of reference models; "vehicle" without ``drivers`` is "ar".
        predictor: File of the model "learned".
        scale: Share of the motion that is wanted; the figures hardly depend on it.
        drivers: What the driver did, one for each sample of the recording.
        horizons: How far ahead [s].
        progress: Called with the model that forecasts and the share of all that is done.

    Raises:
        ValueError: A model or predictor does not exist, or drivers and samples differ in number.
    """
    if drivers is not None and len(drivers) != len(recording.times):
        raise ValueError(f"{len(drivers)} drivers for {len(recording.times)} samples")
    ahead = np.array(horizons)
    rows = []
    for number, name in enumerate(models):

        def share(part: float, number: int = number, name: str = name) -> None:
            if progress is not None:
                progress(name, (number + part) / len(models))

        model = Reference(name, PERIOD, ahead, 0.0, predictor)
        rows.append(forecast_errors(recording, model.predict, ahead, scale, drivers, share))
    return PredictionErrors(recording.name, tuple(horizons), tuple(models), frozen(rows))


def errors_of(recording: Recording, predictor: Predictor, horizons: Array) -> Array:
    """Relative errors of the model "learned" with a predictor that need not be shipped, (2, K)."""
    model = Learned(PERIOD, horizons, predictor)
    return forecast_errors(recording, lambda one: model.predict(one, one.rates), horizons)


def forecast_errors(
    recording: Recording,
    forecaster: Forecaster,
    horizons: Array,
    scale: float = 1.0,
    drivers: Sequence[Driver | None] | None = None,
    share: Share | None = None,
) -> Array:
    """Relative errors of one forecaster, surge and sway, (2, K); NaN where all is quiet."""
    drive = regular(recording)
    stimuli = stimuli_of(drive, scale, _nearest(recording, drive, drivers))
    told = np.empty((len(stimuli), len(horizons), 2))
    for k, one in enumerate(stimuli):
        if share is not None and k % _SECOND == 0:
            share(k / len(stimuli))
        told[k] = forecaster(one)[:, :2]
    told /= scale
    return relative_errors(told, drive, horizons)


def relative_errors(told: Array, drive: Recording, horizons: Array) -> Array:
    """Compare forecasts (N, K, 2) of a regular drive with what came, (2, K)."""
    came = slow_force(drive)
    out = np.full((2, len(horizons)), np.nan)
    begin = round(SETTLE / PERIOD)
    for index, horizon in enumerate(horizons):
        shift = round(float(horizon) / PERIOD)
        truth = came[begin + shift :]
        for axis in range(2):
            size = float(np.sqrt(np.mean(came[begin:, axis] ** 2))) if len(truth) else 0.0
            if size < QUIET:
                continue
            missed = told[begin : len(told) - shift, index, axis] - truth[:, axis]
            out[axis, index] = np.sqrt(np.mean(missed**2)) / size
    return out


def slow_force(drive: Recording) -> Array:
    """Surge and sway of a regular drive, mean over `WINDOW` about each instant, (N, 2) [m/s2]."""
    half = round(0.5 * WINDOW / PERIOD)
    padded = np.pad(drive.force[:, :2], ((half, half), (0, 0)), mode="edge")
    sums = np.cumsum(np.concatenate((np.zeros((1, 2)), padded)), axis=0)
    width = 2 * half + 1
    out: Array = (sums[width:] - sums[:-width]) / width
    return out


def regular(recording: Recording) -> Recording:
    """The same drive with a sample in every period."""
    count = int(recording.duration / PERIOD + 1e-6) + 1
    times: Array = np.arange(count) * np.float64(PERIOD)
    columns = (*recording.force.T, *recording.rates.T, recording.speed)
    table = np.column_stack([np.interp(times, recording.times, column) for column in columns])
    return from_samples(recording.name, times, table[:, :3], table[:, 3:6], table[:, 6])


def stimuli_of(
    drive: Recording, scale: float = 1.0, drivers: Sequence[Driver | None] | None = None
) -> list[Stimulus]:
    """What intake would make of a regular drive, one for each period."""
    force = scale * (drive.force - np.array([0.0, 0.0, GRAVITY]))
    rates = scale * drive.rates
    return [
        Stimulus(
            force[k],
            rates[k],
            share=scale,
            speed=float(drive.speed[k]),
            driver=None if drivers is None else drivers[k],
        )
        for k in range(len(drive.times))
    ]


def to_text(result: PredictionErrors) -> str:
    """The table as aligned text."""
    width = max(map(len, result.models)) + 2
    cells = "".join(f"{horizon:6.2f}" for horizon in result.horizons)
    lines = [
        f"{result.recording}: error of the forecast over rms of what came (1 = expecting nothing)",
        " " * width + "seconds ahead" + " " * max(0, 2 * len(cells) + 4 - 13),
        " " * width + "surge " + cells + "   sway " + cells,
    ]
    for name, errors in zip(result.models, result.errors, strict=True):
        parts = ["".join(_cell(float(value)) for value in axis) for axis in errors]
        lines.append(name.ljust(width) + " " * 6 + parts[0] + " " * 8 + parts[1])
    return "\n".join(line.rstrip() for line in lines) + "\n"


def _cell(value: float) -> str:
    return f"{value:6.2f}" if np.isfinite(value) else "     -"


def _nearest(
    recording: Recording, drive: Recording, drivers: Sequence[Driver | None] | None
) -> list[Driver | None] | None:
    """The newest word of the driver at every instant of the regular drive."""
    if drivers is None:
        return None
    last = np.searchsorted(recording.times, drive.times + 1e-9, side="right") - 1
    return [drivers[int(k)] for k in np.maximum(last, 0)]
