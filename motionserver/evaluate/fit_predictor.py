"""Fit the reference model "learned" to recorded drives: ridge regression of what "ar" missed.

Every recording counts alike, whatever its length and violence: its rows are divided by its own
rms. The ridge of each axis and horizon is the one with the least error on recordings left out, so
a correction that holds on no other drive shrinks to none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from motionserver.core.axes import Array, frozen
from motionserver.cueing.predictor import FEATURES, Predictor
from motionserver.cueing.reference_learned import Features
from motionserver.evaluate.predictions import PERIOD, SETTLE, regular, slow_force, stimuli_of
from motionserver.evaluate.recording import Recording

FIT_HORIZONS: Final = (0.1, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0)
"""Horizons of a fitted map [s]."""
RIDGES: Final = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 1e6)
"""Candidates, in units of the features' own mean square; the last means no correction."""
EVERY: Final = 5
"""Every so many samples one row: neighbours say the same."""
SHORTEST: Final = 10.0
"""A recording, or a part of one, shorter than this is not fitted to [s]."""
PARTS: Final = 4
"""Parts of a single recording, of which one is left out in turn."""
FLOOR: Final = 0.06
"""An axis more quiet than this counts less than the others [m/s2]."""


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


def fit(recordings: Sequence[Recording], name: str, note: str = "") -> Predictor:
    """Fit a predictor.

    Args:
        recordings: Drives of one kind of vehicle. With a single one, its quarters are left out in
            turn instead.
        name: What it is called.
        note: What should be known about the recordings.

    Returns:
        The predictor; its provenance tells the errors on what was left out, chosen without
        looking at it, beside those of "ar".

    Raises:
        ValueError: No recording, or one that is too short.
    """
    if not recordings:
        raise ValueError("no recordings to fit to; give at least one")
    parts = _in_parts(recordings[0]) if len(recordings) == 1 else list(recordings)
    for part in parts:
        if part.duration < SHORTEST:
            raise ValueError(
                f"recording {part.name}: {part.duration:.1f} s is too short to fit to; "
                f"each part needs {SHORTEST:g} s"
            )
    sums = [_condense(part) for part in parts]
    everything = list(range(len(sums)))
    ridges = _best_ridges(sums, everything)
    weights = _solve(sums, everything, ridges)
    return Predictor(
        name,
        frozen(FIT_HORIZONS),
        frozen(weights),
        _provenance(recordings, sums, ridges, note),
    )


def _in_parts(recording: Recording) -> list[Recording]:
    ends = np.linspace(0.0, recording.duration, PARTS + 1)
    return [recording.excerpt(a, b) for a, b in zip(ends[:-1], ends[1:], strict=True)]


def _condense(recording: Recording) -> _Sums:
    drive = regular(recording)
    horizons = np.array(FIT_HORIZONS)
    came = slow_force(drive)
    features = Features(PERIOD, horizons)
    begin = round(SETTLE / PERIOD)
    last = round(horizons[-1] / PERIOD)
    base, rows = [], []
    for k, stimulus in enumerate(stimuli_of(drive)):
        forecast = features.take(stimulus)
        if k >= begin and k % EVERY == 0 and k + last < len(came):
            base.append(forecast)
            rows.append([features.row(axis, stimulus) for axis in range(2)])
    table, bases = np.array(rows), np.array(base)
    at = np.arange(begin + -begin % EVERY, len(came) - last, EVERY)
    shape = (2, len(horizons))
    sums = _Sums(
        recording.name,
        np.zeros((*shape, FEATURES, FEATURES)),
        np.zeros((*shape, FEATURES)),
        np.zeros(shape),
    )
    for axis in range(2):
        unit = np.sqrt(np.mean(came[:, axis] ** 2) + FLOOR**2)
        for m, horizon in enumerate(horizons):
            x = np.column_stack((bases[:, m, axis], table[:, axis])) / unit
            y = (came[at + round(horizon / PERIOD), axis] - bases[:, m, axis]) / unit
            sums.moment[axis, m] = x.T @ x / len(y)
            sums.pull[axis, m] = x.T @ y / len(y)
            sums.missed[axis, m] = y @ y / len(y)
    return sums


def _solve(sums: Sequence[_Sums], kept: Sequence[int], ridges: Array) -> Array:
    """Weights fitted to the ``kept`` with a ridge for each axis and horizon, (2, M, F)."""
    moment = np.mean([sums[k].moment for k in kept], axis=0)
    pull = np.mean([sums[k].pull for k in kept], axis=0)
    size = np.sqrt(np.diagonal(moment, axis1=2, axis2=3)) + 1e-9
    scaled = moment / (size[..., :, None] * size[..., None, :])
    scaled = scaled + ridges[..., None, None] * np.eye(FEATURES)
    out: Array = np.linalg.solve(scaled, (pull / size)[..., None])[..., 0] / size
    return out


def _error(one: _Sums, weights: Array) -> Array:
    """Mean squares of what is missed with these weights, (2, M)."""
    quadratic = np.einsum("amf,amfg,amg->am", weights, one.moment, weights)
    out: Array = one.missed - 2.0 * np.einsum("amf,amf->am", weights, one.pull) + quadratic
    return out


def _best_ridges(sums: Sequence[_Sums], among: Sequence[int]) -> Array:
    """For each axis and horizon the ridge with the least error on each one left out, (2, M)."""
    shape = (2, len(FIT_HORIZONS))
    if len(among) < 2:
        return np.full(shape, RIDGES[-1])
    totals = []
    for ridge in RIDGES:
        total = np.zeros(shape)
        for out in among:
            rest = [k for k in among if k != out]
            total += _error(sums[out], _solve(sums, rest, np.full(shape, ridge)))
        totals.append(total)
    best: Array = np.array(RIDGES)[np.argmin(totals, axis=0)]
    return best


def left_out(sums: Sequence[_Sums]) -> tuple[Array, Array]:
    """Relative rms errors of "ar" and "learned" on each part left out, (parts, 2, M) each.

    The ridge is chosen on the other parts only, by leaving each of those out in turn.
    """
    plain, learned = [], []
    for out in range(len(sums)):
        rest = [k for k in range(len(sums)) if k != out]
        weights = _solve(sums, rest, _best_ridges(sums, rest))
        plain.append(np.sqrt(sums[out].missed))
        learned.append(np.sqrt(np.maximum(_error(sums[out], weights), 0.0)))
    return np.array(plain), np.array(learned)


def _provenance(
    recordings: Sequence[Recording], sums: Sequence[_Sums], ridges: Array, note: str
) -> dict[str, Any]:
    plain, learned = left_out(sums)
    names = [one.name for one in sums]
    if len(recordings) == 1:
        names = [f"{one.name}, part {k + 1} of {PARTS}" for k, one in enumerate(sums)]
    axes = ("surge", "sway")
    return {
        "note": note,
        "recordings": {r.name: {"seconds": round(r.duration, 2)} for r in recordings},
        "method": "ridge regression of what the autoregressive forecast misses of the 0.2 s mean, "
        f"every {EVERY * PERIOD:g} s, each recording divided by its rms; ridge by leaving out",
        "ridge": {axis: [float(r) for r in ridges[k]] for k, axis in enumerate(axes)},
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
