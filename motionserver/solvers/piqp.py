"""PIQP: dense interior-point method; exact, and its iterates stay inside the bounds."""

from __future__ import annotations

import numpy as np
import piqp

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


class Piqp:
    """PIQP's dense solver. It wants ``inf`` for absent bounds and a duality-gap tolerance."""

    name = "piqp"

    def __init__(self, iterations: int = 60, tolerance: float = 1e-8) -> None:
        self._iterations = iterations
        self._tolerance = tolerance
        self._solver: piqp.DenseSolver | None = None
        self._shape: tuple[int, int, int] | None = None
        self._matrices: QpMatrices | None = None

    def solve(self, vectors: QpVectors, matrices: QpMatrices | None = None) -> QpResult:
        """Solve; see `QpBackend.solve`."""
        self._shape = checked_shapes(vectors, matrices, self._shape)
        n, m, b = self._shape
        if not finite(vectors, matrices):
            return no_solution(n)
        if matrices is not None:
            self._matrices = QpMatrices(
                np.asfortranarray(matrices.H, dtype=np.float64),
                np.asfortranarray(matrices.A, dtype=np.float64),
            )
        assert self._matrices is not None
        box = np.full((2, n), np.inf)
        box[0, :b], box[1, :b] = _bounded(vectors.box_lower), _bounded(vectors.box_upper)
        box[0, b:] = -np.inf
        lower, upper = _bounded(vectors.lower), _bounded(vectors.upper)
        if (box[0] > box[1]).any() or (lower > upper).any():
            return no_solution(n, QpStatus.INFEASIBLE)
        rows = self._matrices.A if m else None
        bounds = {"h_l": lower, "h_u": upper} if m else {}
        if self._solver is None:
            self._solver = self._fresh()
            self._solver.setup(
                self._matrices.H, vectors.q, G=rows, x_l=box[0], x_u=box[1], **bounds
            )
        elif matrices is not None:
            self._solver.update(
                P=self._matrices.H, c=vectors.q, G=rows, x_l=box[0], x_u=box[1], **bounds
            )
        else:
            self._solver.update(c=vectors.q, x_l=box[0], x_u=box[1], **bounds)
        status = self._solver.solve()
        iterations = int(self._solver.result.info.iter)
        x = np.array(self._solver.result.x, dtype=np.float64)
        if status == piqp.PIQP_SOLVED and np.isfinite(x).all():
            return QpResult(x, QpStatus.SOLVED, iterations)
        if status == piqp.PIQP_MAX_ITER_REACHED and np.isfinite(x).all():
            return QpResult(x, QpStatus.BUDGET, iterations)
        self._solver = None
        infeasible = status == piqp.PIQP_PRIMAL_INFEASIBLE
        return no_solution(n, QpStatus.INFEASIBLE if infeasible else QpStatus.FAILED, iterations)

    def _fresh(self) -> piqp.DenseSolver:
        solver = piqp.DenseSolver()
        settings = solver.settings
        settings.eps_abs = settings.eps_rel = self._tolerance
        settings.check_duality_gap = True
        settings.eps_duality_gap_abs = settings.eps_duality_gap_rel = self._tolerance
        settings.max_iter = self._iterations
        settings.verbose = False
        return solver


def _bounded(bounds: Array) -> Array:
    return np.where(np.abs(bounds) >= INFINITE, np.copysign(np.inf, bounds), bounds)
