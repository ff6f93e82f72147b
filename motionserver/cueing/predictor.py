"""A fitted predictor: matrices, what they were fitted on, and how well they did elsewhere."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from motionserver.bounded_files import MIB, read_bounded_text
from motionserver.core.axes import Array, frozen

FORMAT: Final = "motionserver-predictor-1"
FEATURES: Final = 22
"""Length of a row of features, see `reference_learned.Features`."""
FORCE_FEATURES: Final = 10
"""Those of them at the beginning that hold nothing but the force of that axis."""
LARGEST_FILE: Final = 4 * MIB
LARGEST_WEIGHT: Final = 100.0
"""No fit in its right mind has a larger weight."""


class PredictorError(ValueError):
    """A predictor that does not exist, or a file that is none."""


@dataclass(frozen=True, slots=True)
class Predictor:
    """Corrections to the autoregressive forecast, linear in `FEATURES` features.

    Attributes:
        name: How it is called.
        horizons: How far ahead, (M,), increasing [s].
        weights: Surge and sway: correction = weights @ features, (2, M, F).
        provenance: What it was fitted on and how; errors on recordings left out. Plain JSON.
    """

    name: str
    horizons: Array
    weights: Array
    provenance: dict[str, Any]


def save(predictor: Predictor, path: Path) -> None:
    """Write a predictor as JSON text."""
    data = {
        "format": FORMAT,
        "name": predictor.name,
        "provenance": predictor.provenance,
        "horizons_s": [float(h) for h in predictor.horizons],
        "surge": _rows(predictor.weights[0]),
        "sway": _rows(predictor.weights[1]),
    }
    text = json.dumps(data, indent=1)
    # a row of numbers is one line
    text = re.sub(r"\[[^][{}]*\]", lambda row: " ".join(row.group().split()), text)
    path.write_text(text + "\n", "utf-8")


def load(path: Path) -> Predictor:
    """Read a predictor.

    Raises:
        PredictorError: The file cannot be read or holds no predictor.
    """
    try:
        data = json.loads(read_bounded_text(path, LARGEST_FILE))
        if data["format"] != FORMAT:
            raise PredictorError(f"{path}: format {data['format']!r}; this reads {FORMAT!r}")
        horizons = frozen(data["horizons_s"])
        weights = frozen([data["surge"], data["sway"]])
        predictor = Predictor(str(data["name"]), horizons, weights, dict(data["provenance"]))
    except OSError as error:
        raise PredictorError(f"{path}: cannot be read ({error.strerror})") from error
    except PredictorError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise PredictorError(f"{path}: is no predictor ({error}); fit it anew") from error
    check(predictor, str(path))
    return predictor


def check(predictor: Predictor, where: str) -> None:
    """Refuse what would not work or not be bounded.

    Raises:
        PredictorError: Shapes, order of horizons or size of the weights are wrong.
    """
    horizons, weights = predictor.horizons, predictor.weights
    if horizons.ndim != 1 or len(horizons) < 1 or not bool(np.all(np.diff(horizons) > 0.0)):
        raise PredictorError(f"{where}: horizons_s must increase")
    if not horizons[0] > 0.0:
        raise PredictorError(f"{where}: horizons_s must be above 0")
    if weights.shape != (2, len(horizons), FEATURES):
        raise PredictorError(
            f"{where}: surge and sway have the shape {weights.shape[1:]}; needed is "
            f"({len(horizons)}, {FEATURES})"
        )
    if not bool(np.all(np.abs(weights) <= LARGEST_WEIGHT)):
        raise PredictorError(f"{where}: a weight is no number or beyond {LARGEST_WEIGHT:g}")


def chosen(path: str) -> Predictor:
    """The predictor that a tuning names.

    Raises:
        PredictorError: None is named, or the file is none.
    """
    if not path:
        raise PredictorError("the reference model 'learned' needs a predictor, and none is named")
    return load(Path(path))


def _rows(matrix: Array) -> list[list[float]]:
    return [[round(float(value), 6) for value in row] for row in matrix]
