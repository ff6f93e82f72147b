"""Solve with the few rows that can matter, then see that the others hold: the same optimum, sooner.

What a dense solver does before its first iteration costs in proportion to the rows. Around a
nominal most of them are far from binding, so only the nearest are handed over. An optimum of fewer
rows that keeps all of them is the optimum; otherwise the whole programme is solved.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np

from motionserver.core.axes import Array
from motionserver.solvers.base import QpBackend, QpMatrices, QpResult, QpVectors

KEPT: Final = 160
"""Rows handed over. Of 3000 programmes in lively driving, 99.9 % of all binding rows were measured
to be among the nearest 62."""
TOLERANCE: Final = 1e-6
"""By how much a row that was left out may be exceeded, as a share of its norm."""
_LEAST_NORM: Final = 1e-9
"""A row below it says nothing that a step could change."""


class Screened:
    """A dense backend that sees the nearest rows only, as long as that is enough.

    Nearness is the room at x = 0: the programme must be written about a nominal that nearly keeps
    its rows. Rows keep their places from solve to solve, so that a warm start means the same ones.

    Args:
        make: Makes the dense backend.
        kept: Rows handed over.

    Attributes:
        widened: Solves so far that needed the whole programme.
    """

    def __init__(self, make: Callable[[], QpBackend], kept: int = KEPT) -> None:
        self._make, self._backend, self._kept = make, make(), kept
        self.name = self._backend.name
        self._places: np.ndarray = np.arange(kept)
        self.widened = 0

    def solve(self, vectors: QpVectors, matrices: QpMatrices | None = None) -> QpResult:
        """Solve; see `QpBackend.solve`. The matrices are needed every time."""
        if matrices is None:
            raise ValueError("screened qp: got no matrices; pass them at every solve")
        rows = matrices.A
        if len(rows) <= self._kept:
            return self._backend.solve(vectors, matrices)
        norm = np.sqrt(np.einsum("ij,ij->i", rows, rows))
        room = np.minimum(vectors.upper, -vectors.lower) / np.maximum(norm, _LEAST_NORM)
        chosen = self._choose(room)
        near = replace(vectors, lower=vectors.lower[chosen], upper=vectors.upper[chosen])
        result = self._backend.solve(near, QpMatrices(matrices.H, rows[chosen]))
        if not result.usable:
            return result
        reached = rows @ result.x
        over = np.maximum(reached - vectors.upper, vectors.lower - reached)
        over[chosen] = 0.0
        if (over <= TOLERANCE * norm).all():
            return result
        self.widened += 1
        # what the last whole solve ended with would be a stale start
        return self._make().solve(vectors, matrices)

    def _choose(self, room: Array) -> np.ndarray:
        """The nearest rows, each where it was last time."""
        wanted = np.zeros(len(room), dtype=bool)
        wanted[np.argpartition(room, self._kept)[: self._kept]] = True
        stay = wanted[self._places]
        wanted[self._places[stay]] = False
        self._places[~stay] = np.flatnonzero(wanted)
        return self._places
