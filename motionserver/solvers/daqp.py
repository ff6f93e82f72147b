"""DAQP: exact dual active-set method for dense programmes; the default."""

from __future__ import annotations

import daqp
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

_NO_BOUND = 1e30
_INFEASIBLE = -1
_BUDGET = -4


class Daqp:
    """One kept ``Model``, updated in place; rebuilt after any failure.

    Iterates are worthless before the optimum, so a result with status BUDGET must not be used.
    """

    name = "daqp"

    def __init__(self, iterations: int = 400) -> None:
        self._iterations = iterations
        self._model: daqp.Model | None = None
        self._shape: tuple[int, int, int] | None = None
        self._matrices: QpMatrices | None = None
        self._last_h: Array | None = None

    def solve(self, vectors: QpVectors, matrices: QpMatrices | None = None) -> QpResult:
        """Solve; see `QpBackend.solve`."""
        self._shape = checked_shapes(vectors, matrices, self._shape)
        if not finite(vectors, matrices):
            return no_solution(len(vectors.q))
        if matrices is not None:
            # it takes no read-only arrays
            self._matrices = QpMatrices(
                np.require(matrices.H, np.float64, ["C", "W"]),
                np.require(matrices.A, np.float64, ["C", "W"]),
            )
        assert self._matrices is not None
        upper = _bounded(np.concatenate((vectors.box_upper, vectors.upper)))
        lower = _bounded(np.concatenate((vectors.box_lower, vectors.lower)))
        q = np.require(vectors.q, np.float64, ["C", "W"])
        if self._model is None:
            flag = self._set_up(q, upper, lower)
        elif matrices is None:
            flag = self._model.update(f=q, bupper=upper, blower=lower)
        else:
            h = None if matrices.H is self._last_h else self._matrices.H
            flag = self._model.update(H=h, A=self._matrices.A, f=q, bupper=upper, blower=lower)
        if matrices is not None:
            self._last_h = matrices.H
        if flag < 0 or self._model is None:
            self._model = None
            status = QpStatus.INFEASIBLE if flag == _INFEASIBLE else QpStatus.FAILED
            return no_solution(len(q), status)
        x, _, flag, info = self._model.solve()
        iterations = int(info["iterations"])
        if flag > 0 and np.isfinite(x).all():
            return QpResult(x, QpStatus.SOLVED, iterations)
        # its working set may be unsound now: begin afresh next time
        self._model = None
        if flag == _BUDGET:
            return QpResult(x, QpStatus.BUDGET, iterations)
        status = QpStatus.INFEASIBLE if flag == _INFEASIBLE else QpStatus.FAILED
        return no_solution(len(q), status, iterations)

    def _set_up(self, q: Array, upper: Array, lower: Array) -> int:
        assert self._matrices is not None
        model = daqp.Model()
        model.settings = {"iter_limit": self._iterations}
        flag, _ = model.setup(self._matrices.H, q, self._matrices.A, upper, lower)
        self._model = model if flag >= 0 else None
        return int(flag)


def _bounded(bounds: Array) -> Array:
    return np.where(np.abs(bounds) >= INFINITE, np.copysign(_NO_BOUND, bounds), bounds)
