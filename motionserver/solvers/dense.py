"""What the dense backends share: checks before a solve, kept matrices, the result after it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from motionserver.core.axes import Array
from motionserver.solvers.base import (
    INFINITE,
    QpMatrices,
    QpResult,
    QpStatus,
    QpVectors,
    checked_shapes,
    finite,
    no_solution,
)


@dataclass(frozen=True, slots=True)
class Bounds:
    """Bounds of the first variables and of the rows below them, absent ones as the library wants.

    Attributes:
        lower: (b + m,).
        upper: (b + m,).
        box: b, how many of them are of variables.
    """

    lower: Array
    upper: Array
    box: int


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a library said: its last iterate, how it ended, iterations used."""

    x: Array | None
    status: QpStatus
    iterations: int = 0


class DenseBackend(ABC):
    """One dense programme of fixed size, solved again and again.

    A subclass keeps its library's object and answers `_run`; after anything but SOLVED or BUDGET
    it is told to `_forget` it, so that nothing poisoned warm-starts the next solve.
    """

    name: ClassVar[str]
    no_bound: ClassVar[float]
    """How the library writes an absent bound."""
    cut_short_usable: ClassVar[bool]
    """Whether an iterate is worth anything when the budget is used up."""

    def __init__(self) -> None:
        self._shape: tuple[int, int, int] | None = None
        self._matrices: QpMatrices | None = None

    def solve(self, vectors: QpVectors, matrices: QpMatrices | None = None) -> QpResult:
        """Solve; see `QpBackend.solve`."""
        self._shape = checked_shapes(vectors, matrices, self._shape)
        n = len(vectors.q)
        if not finite(vectors, matrices):
            return no_solution(n)
        fresh = matrices is not None or self._matrices is None
        if matrices is not None:
            self._matrices = self._keep(matrices)
        if self._matrices is None:
            # the first matrices were not finite
            return no_solution(n)
        bounds = self._bounds(vectors)
        if (bounds.lower > bounds.upper).any():
            return no_solution(n, QpStatus.INFEASIBLE)
        outcome = self._run(vectors.q, bounds, self._matrices, fresh)
        x, status = outcome.x, outcome.status
        if status not in (QpStatus.SOLVED, QpStatus.BUDGET):
            self._forget()
            return no_solution(n, status, outcome.iterations)
        if x is None or not np.isfinite(x).all():
            self._forget()
            return no_solution(n, QpStatus.FAILED, outcome.iterations)
        usable = status is QpStatus.SOLVED or self.cut_short_usable
        return QpResult(x, status, outcome.iterations, usable)

    def _bounds(self, vectors: QpVectors) -> Bounds:
        lower = np.concatenate((vectors.box_lower, vectors.lower))
        upper = np.concatenate((vectors.box_upper, vectors.upper))
        for bounds in (lower, upper):
            absent = np.abs(bounds) >= INFINITE
            bounds[absent] = np.copysign(self.no_bound, bounds[absent])
        return Bounds(lower, upper, len(vectors.box_lower))

    def _keep(self, matrices: QpMatrices) -> QpMatrices:
        """The matrices as the library wants them in memory."""
        return matrices

    @abstractmethod
    def _run(self, q: Array, bounds: Bounds, matrices: QpMatrices, fresh: bool) -> Outcome:
        """Hand over and solve; ``fresh`` means that the matrices are not those of last time."""

    @abstractmethod
    def _forget(self) -> None:
        """Begin afresh next time."""
