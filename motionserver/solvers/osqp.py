"""OSQP: operator splitting; inexact, installs everywhere."""

from __future__ import annotations

import numpy as np
import osqp
from scipy import sparse

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

_NO_BOUND = 1e30


class Osqp:
    """OSQP with a fixed dense pattern, so that new matrices are new values only.

    At the default tolerance bounds are met to about 1e-3 of their own size: scale rows so that 1
    means a full limit.
    """

    name = "osqp"

    def __init__(self, iterations: int = 250, tolerance: float = 1e-3) -> None:
        self._iterations = iterations
        self._tolerance = tolerance
        self._solver: osqp.OSQP | None = None
        self._shape: tuple[int, int, int] | None = None
        self._matrices: QpMatrices | None = None

    def solve(self, vectors: QpVectors, matrices: QpMatrices | None = None) -> QpResult:
        """Solve; see `QpBackend.solve`."""
        self._shape = checked_shapes(vectors, matrices, self._shape)
        n = len(vectors.q)
        if not finite(vectors, matrices):
            return no_solution(n)
        if matrices is not None:
            self._matrices = matrices
        lower = _bounded(np.concatenate((vectors.box_lower, vectors.lower)))
        upper = _bounded(np.concatenate((vectors.box_upper, vectors.upper)))
        if (lower > upper).any():
            return no_solution(n, QpStatus.INFEASIBLE)
        try:
            result = self._run(vectors.q, lower, upper, matrices is not None)
        except (ValueError, osqp.OSQPException):
            # numbers it will not even take (a Hessian that is not convex): no solution, no crash
            self._solver = None
            return no_solution(n)
        iterations = int(result.info.iter)
        status = int(result.info.status_val)
        solved = status == osqp.SolverStatus.OSQP_SOLVED
        x = np.asarray(result.x, dtype=np.float64)
        if solved and np.isfinite(x).all():
            return QpResult(x, QpStatus.SOLVED, iterations)
        cut_short = (
            osqp.SolverStatus.OSQP_MAX_ITER_REACHED,
            osqp.SolverStatus.OSQP_SOLVED_INACCURATE,
        )
        if status in cut_short and np.isfinite(x).all():
            return QpResult(x, QpStatus.BUDGET, iterations)
        self._solver = None
        infeasible = status in (
            osqp.SolverStatus.OSQP_PRIMAL_INFEASIBLE,
            osqp.SolverStatus.OSQP_PRIMAL_INFEASIBLE_INACCURATE,
        )
        return no_solution(n, QpStatus.INFEASIBLE if infeasible else QpStatus.FAILED, iterations)

    def _run(self, q: Array, lower: Array, upper: Array, fresh: bool) -> osqp.OSQPResult:
        assert self._matrices is not None
        assert self._shape is not None
        n, m, b = self._shape
        upper_part = np.tril_indices(n)[::-1]
        if self._solver is None:
            hessian = sparse.csc_array(np.triu(np.ones((n, n))))
            hessian.data = self._matrices.H[upper_part]
            rows = sparse.csc_array(np.vstack((np.eye(b, n), np.ones((m, n)))))
            rows.data = self._row_values(b)
            self._solver = osqp.OSQP()
            self._solver.setup(
                sparse.csc_matrix(hessian),
                q,
                sparse.csc_matrix(rows),
                lower,
                upper,
                eps_abs=self._tolerance,
                eps_rel=self._tolerance,
                max_iter=self._iterations,
                check_termination=25,
                verbose=False,
            )
        elif fresh:
            self._solver.update(
                Px=self._matrices.H[upper_part], Ax=self._row_values(b), q=q, l=lower, u=upper
            )
        else:
            self._solver.update(q=q, l=lower, u=upper)
        return self._solver.solve(raise_error=False)

    def _row_values(self, b: int) -> Array:
        """Values of [I; A] column by column, as the fixed pattern wants them."""
        assert self._matrices is not None
        m, n = self._matrices.A.shape
        table = np.empty((n, m + 1))
        table[:, 0] = 1.0
        table[:, 1:] = self._matrices.A.T
        return np.concatenate((table[:b].ravel(), table[b:, 1:].ravel()))


def _bounded(bounds: Array) -> Array:
    return np.where(np.abs(bounds) >= INFINITE, np.copysign(_NO_BOUND, bounds), bounds)
