"""Fit the reference model "learned" to recorded drives: ridge regression of what "ar" missed.

Every recording counts alike, whatever its length and violence: its rows are divided by its own
rms. How much each axis is shrunk towards no correction is decided on recordings left out: the least
mean error among what harms none of them, so a correction that holds on no other drive is none.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from motionserver.core.axes import Array, frozen
from motionserver.cueing.predictor import FEATURES, FORCE_FEATURES, Predictor
from motionserver.cueing.reference_learned import Features
from motionserver.evaluate.predictions import PERIOD, SETTLE, regular, slow_force, stimuli_of
from motionserver.evaluate.recording import Recording

FIT_HORIZONS: Final = (0.1, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0)
"""Horizons of a fitted map [s]."""
RIDGES: Final = (0.03, 0.1, 0.3, 1.0, 3.0)
"""Ridge of forecasts one second ahead, in units of the features' own mean square."""
POWERS: Final = (0.0, 1.0)
"""How the ridge grows towards shorter horizons: with this power of 1 s / horizon."""
WITHOUT: Final = 1e6
EXTRAS: Final = (10.0, WITHOUT)
"""Ridge of rates and of products with speed over that of the force itself; or without them."""
ENOUGH: Final = 8
"""Fewer different drives cannot tell whether rates and speed help on another one: the five truck
recordings choose them, and the error of the sixth kind of road grows by a third."""
EVERY: Final = 5
"""Every so many samples one row: neighbours say the same."""
SHORTEST: Final = 10.0
"""A recording, or a part of one, shorter than this is not fitted to [s]."""
SCALE: Final = 0.5
"""The drives are fitted as they are shown: forecasts of a shown force are bounded."""
PARTS: Final = 4
"""Parts of a single recording, of which one is left out in turn."""
FLOOR: Final = 0.03
"""An axis shown more quietly than this counts less than the others [m/s2]."""


@dataclass(frozen=True, slots=True)
class _Sums:
    """One recording, condensed: for every axis and horizon."""

    name: str
    moment: Array
    """Mean of features x features, (2, M, F, F)."""
    pull: Array
    """Mean of features x what was missed, (2, M, F)."""
    missed: Array
    """Mean square of what was missed, (2, M)."""


def fit(
    recordings: Sequence[Recording],
    name: str,
    note: str = "",
    progress: Callable[[str, int, int], None] | None = None,
) -> Predictor:
    """Fit a predictor.

    Args:
        recordings: Drives of one kind of vehicle. With a single one, its quarters are left out in
            turn instead.
        name: What it is called.
        note: What should be known about the recordings.
        progress: Called with what is being done, recordings condensed, recordings in all.

    Returns:
        The predictor; its provenance tells the errors on what was left out, chosen without
        looking at it, beside those of "ar".

    Raises:
        ValueError: No recording, or one that is too short.
    """
    if not recordings:
        raise ValueError("no recordings to fit to; give at least one")
    parts = PARTS if len(recordings) == 1 else 1
    for recording in recordings:
        if recording.duration < parts * SHORTEST:
            raise ValueError(
                f"recording {recording.name}: {recording.duration:.1f} s is too short to fit to; "
                f"it needs {parts * SHORTEST:g} s"
            )
    sums: list[_Sums] = []
    for number, recording in enumerate(recordings):
        if progress is not None:
            progress("forecast", number, len(recordings))
        sums += _condense(recording, parts)
    if progress is not None:
        progress("forecast", len(recordings), len(recordings))
    everything = list(range(len(sums)))
    one_vehicle = len(recordings) == 1 or len(recordings) >= ENOUGH
    extras = EXTRAS if one_vehicle else (WITHOUT,)
    ridges = [_best_ridge(sums, everything, axis, extras) for axis in range(2)]
    weights = [_solve(sums, everything, axis, ridges[axis]) for axis in range(2)]
    return Predictor(
        name,
        frozen(FIT_HORIZONS),
        frozen(weights),
        _provenance(recordings, sums, ridges, _left_out(sums, extras), note),
    )


def _condense(recording: Recording, parts: int) -> list[_Sums]:
    """Sums of a recording, or of its parts; the forecasts learn through all of them."""
    drive = regular(recording)
    horizons = np.array(FIT_HORIZONS)
    came = SCALE * slow_force(drive)
    features = Features(PERIOD, horizons)
    base, rows = [], []
    for k, stimulus in enumerate(stimuli_of(drive, SCALE)):
        forecast = features.take(stimulus, stimulus.rates)
        if k % EVERY == 0:
            base.append(forecast)
            rows.append([features.row(axis, stimulus) for axis in range(2)])
    table, bases = np.array(rows), np.array(base)
    edges = np.linspace(round(SETTLE / PERIOD), len(came), parts + 1).astype(int)
    last = round(horizons[-1] / PERIOD)
    out = []
    for begin, end in itertools.pairwise(edges):
        # what is foretold lies in the same part, so that no part has seen another
        at = np.arange(begin + -begin % EVERY, end - last, EVERY)
        out.append(_sums(recording.name, came, at, bases[at // EVERY], table[at // EVERY]))
    return out


def _sums(name: str, came: Array, at: Array, bases: Array, table: Array) -> _Sums:
    shape = (2, len(FIT_HORIZONS))
    sums = _Sums(
        name,
        np.zeros((*shape, FEATURES, FEATURES)),
        np.zeros((*shape, FEATURES)),
        np.zeros(shape),
    )
    for axis in range(2):
        unit = np.sqrt(np.mean(came[at, axis] ** 2) + FLOOR**2)
        for m, horizon in enumerate(FIT_HORIZONS):
            x = np.column_stack((bases[:, m, axis], table[:, axis])) / unit
            y = (came[at + round(horizon / PERIOD), axis] - bases[:, m, axis]) / unit
            sums.moment[axis, m] = x.T @ x / len(y)
            sums.pull[axis, m] = x.T @ y / len(y)
            sums.missed[axis, m] = y @ y / len(y)
    return sums


@dataclass(frozen=True, slots=True)
class _Ridge:
    """How much one axis is shrunk; see the constants of the same names."""

    ridge: float
    power: float
    extra: float

    def of_features(self) -> Array:
        """Ridge of each horizon and feature, (M, F)."""
        growth = np.array(FIT_HORIZONS) ** -self.power
        kinds = np.ones(FEATURES)
        kinds[FORCE_FEATURES:] = self.extra
        out: Array = self.ridge * growth[:, None] * kinds
        return out


NONE: Final = _Ridge(1e12, 0.0, 1.0)


def _candidates(extras: Sequence[float]) -> list[_Ridge]:
    return [_Ridge(*each) for each in itertools.product(RIDGES, POWERS, extras)]


def _solve(sums: Sequence[_Sums], kept: Sequence[int], axis: int, ridge: _Ridge) -> Array:
    """Weights of one axis fitted to the ``kept``, (M, F)."""
    moment = np.mean([sums[k].moment[axis] for k in kept], axis=0)
    pull = np.mean([sums[k].pull[axis] for k in kept], axis=0)
    size = np.sqrt(np.diagonal(moment, axis1=1, axis2=2)) + 1e-9
    scaled = moment / (size[:, :, None] * size[:, None, :])
    scaled = scaled + ridge.of_features()[:, :, None] * np.eye(FEATURES)
    out: Array = np.linalg.solve(scaled, (pull / size)[..., None])[..., 0] / size
    return out


def _error(one: _Sums, axis: int, weights: Array) -> Array:
    """Relative rms of what is missed with these weights (M, F), (M,)."""
    quadratic = np.einsum("mf,mfg,mg->m", weights, one.moment[axis], weights)
    square = one.missed[axis] - 2.0 * np.einsum("mf,mf->m", weights, one.pull[axis]) + quadratic
    out: Array = np.sqrt(np.maximum(square, 0.0))
    return out


def _best_ridge(
    sums: Sequence[_Sums], among: Sequence[int], axis: int, extras: Sequence[float]
) -> _Ridge:
    """The ridge with the least mean error on each one left out, among those that harm none."""
    if len(among) < 2:
        return NONE
    plain = np.array([np.mean(np.sqrt(sums[k].missed[axis])) for k in among])
    best, least = NONE, float(plain.mean())
    for ridge in _candidates(extras):
        errors = np.empty(len(among))
        for place, out in enumerate(among):
            weights = _solve(sums, [k for k in among if k != out], axis, ridge)
            errors[place] = np.mean(_error(sums[out], axis, weights))
        harmless = bool(np.all(errors <= plain + 1e-9))
        if harmless and errors.mean() < least:
            best, least = ridge, float(errors.mean())
    return best


def _left_out(sums: Sequence[_Sums], extras: Sequence[float]) -> tuple[Array, Array]:
    """Relative rms errors of "ar" and "learned" on each part left out, (parts, 2, M) each.

    The ridge is chosen on the other parts only, by leaving each of those out in turn.
    """
    plain = np.sqrt([one.missed for one in sums])
    learned = np.empty_like(plain)
    for out in range(len(sums)):
        rest = [k for k in range(len(sums)) if k != out]
        for axis in range(2):
            weights = _solve(sums, rest, axis, _best_ridge(sums, rest, axis, extras))
            learned[out, axis] = _error(sums[out], axis, weights)
    return plain, learned


def _provenance(
    recordings: Sequence[Recording],
    sums: Sequence[_Sums],
    ridges: Sequence[_Ridge],
    errors: tuple[Array, Array],
    note: str,
) -> dict[str, Any]:
    plain, learned = errors
    names = [one.name for one in sums]
    if len(recordings) == 1:
        names = [f"{one.name}, part {k + 1} of {PARTS}" for k, one in enumerate(sums)]
    axes = ("surge", "sway")
    return {
        "note": note,
        "recordings": {r.name: {"seconds": round(r.duration, 2)} for r in recordings},
        "method": "ridge regression of what the autoregressive forecast misses of the 0.2 s mean, "
        f"every {EVERY * PERIOD:g} s, each recording divided by its rms; ridge by leaving out",
        "ridge": {
            axis: {"one_second": r.ridge, "power": r.power, "extra": r.extra}
            for axis, r in zip(axes, ridges, strict=True)
        },
        "left_out": {
            name: {
                axis: {
                    "ar": [round(float(v), 3) for v in plain[k, a]],
                    "learned": [round(float(v), 3) for v in learned[k, a]],
                }
                for a, axis in enumerate(axes)
            }
            for k, name in enumerate(names)
        },
    }
