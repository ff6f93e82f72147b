"""OSQP: operator splitting; inexact, installs everywhere."""

from __future__ import annotations

from typing import ClassVar, Final

import numpy as np
import osqp
from scipy import sparse

from motionserver.core.axes import Array
from motionserver.solvers.base import QpMatrices, QpStatus
from motionserver.solvers.dense import Bounds, DenseBackend, Outcome

_CHECK_EVERY: Final = 25
"""Iterations between its tests for convergence."""
_ENDINGS: Final = {
    osqp.SolverStatus.OSQP_SOLVED: QpStatus.SOLVED,
    osqp.SolverStatus.OSQP_SOLVED_INACCURATE: QpStatus.BUDGET,
    osqp.SolverStatus.OSQP_MAX_ITER_REACHED: QpStatus.BUDGET,
    osqp.SolverStatus.OSQP_PRIMAL_INFEASIBLE: QpStatus.INFEASIBLE,
    osqp.SolverStatus.OSQP_PRIMAL_INFEASIBLE_INACCURATE: QpStatus.INFEASIBLE,
}


class Osqp(DenseBackend):
    """OSQP with a fixed dense pattern, so that new matrices are new values only.

    At the default tolerance bounds are met to about 1e-3 of their own size: scale rows so that 1
    means a full limit. Cut short at 50 iterations it was measured to break bounds by up to 0.4 %.
    """

    name: ClassVar[str] = "osqp"
    no_bound: ClassVar[float] = 1e30
    cut_short_usable: ClassVar[bool] = True

    def __init__(self, iterations: int = 250, tolerance: float = 1e-3) -> None:
        super().__init__()
        self._iterations = iterations
        self._tolerance = tolerance
        self._solver: osqp.OSQP | None = None

    def _run(self, q: Array, bounds: Bounds, matrices: QpMatrices, fresh: bool) -> Outcome:
        try:
            found = self._found(q, bounds, matrices, fresh)
        except (ValueError, osqp.OSQPException):
            # numbers it will not even take (a Hessian that is not convex): no solution, no crash
            return Outcome(None, QpStatus.FAILED)
        status = _ENDINGS.get(int(found.info.status_val), QpStatus.FAILED)
        return Outcome(np.asarray(found.x, dtype=np.float64), status, int(found.info.iter))

    def _found(
        self, q: Array, bounds: Bounds, matrices: QpMatrices, fresh: bool
    ) -> osqp.OSQPResult:
        lower, upper, b = bounds.lower, bounds.upper, bounds.box
        if self._solver is None:
            self._solver = self._set_up(q, bounds, matrices)
        elif fresh:
            self._solver.update(
                Px=_upper_part(matrices.H), Ax=_row_values(matrices.A, b), q=q, l=lower, u=upper
            )
        else:
            self._solver.update(q=q, l=lower, u=upper)
        return self._solver.solve(raise_error=False)

    def _set_up(self, q: Array, bounds: Bounds, matrices: QpMatrices) -> osqp.OSQP:
        (m, n), b = matrices.A.shape, bounds.box
        hessian = sparse.csc_array(np.triu(np.ones((n, n))))
        hessian.data = _upper_part(matrices.H)
        rows = sparse.csc_array(np.vstack((np.eye(b, n), np.ones((m, n)))))
        rows.data = _row_values(matrices.A, b)
        solver = osqp.OSQP()
        solver.setup(
            sparse.csc_matrix(hessian),
            q,
            sparse.csc_matrix(rows),
            bounds.lower,
            bounds.upper,
            eps_abs=self._tolerance,
            eps_rel=self._tolerance,
            max_iter=self._iterations,
            check_termination=_CHECK_EVERY,
            verbose=False,
        )
        return solver

    def _forget(self) -> None:
        self._solver = None


def _upper_part(hessian: Array) -> Array:
    """Values of the upper triangle column by column."""
    out: Array = hessian[np.tril_indices(len(hessian))[::-1]]
    return out


def _row_values(rows: Array, b: int) -> Array:
    """Values of [I; A] column by column, as the fixed pattern wants them."""
    m, n = rows.shape
    table = np.empty((n, m + 1))
    table[:, 0] = 1.0
    table[:, 1:] = rows.T
    return np.concatenate((table[:b].ravel(), table[b:, 1:].ravel()))
