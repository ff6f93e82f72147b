"""PIQP: dense interior-point method; exact, and its iterates stay inside the bounds."""

from __future__ import annotations

from typing import ClassVar, Final

import numpy as np
import piqp

from motionserver.core.axes import Array
from motionserver.solvers.base import QpMatrices, QpStatus
from motionserver.solvers.dense import Bounds, DenseBackend, Outcome

_ENDINGS: Final = {
    piqp.PIQP_SOLVED: QpStatus.SOLVED,
    piqp.PIQP_MAX_ITER_REACHED: QpStatus.BUDGET,
    piqp.PIQP_PRIMAL_INFEASIBLE: QpStatus.INFEASIBLE,
}


class Piqp(DenseBackend):
    """PIQP's dense solver. It wants ``inf`` for absent bounds and a duality-gap tolerance."""

    name: ClassVar[str] = "piqp"
    no_bound: ClassVar[float] = np.inf
    cut_short_usable: ClassVar[bool] = True

    def __init__(self, iterations: int = 60, tolerance: float = 1e-8) -> None:
        super().__init__()
        self._iterations = iterations
        self._tolerance = tolerance
        self._solver: piqp.DenseSolver | None = None
        self._absent: np.ndarray = np.empty(0, dtype=bool)

    def _keep(self, matrices: QpMatrices) -> QpMatrices:
        return QpMatrices(
            np.asfortranarray(matrices.H, dtype=np.float64),
            np.asfortranarray(matrices.A, dtype=np.float64),
        )

    def _run(self, q: Array, bounds: Bounds, matrices: QpMatrices, fresh: bool) -> Outcome:
        b = bounds.box
        box_lower, box_upper = np.full(len(q), -np.inf), np.full(len(q), np.inf)
        box_lower[:b], box_upper[:b] = bounds.lower[:b], bounds.upper[:b]
        limits = {"x_l": box_lower, "x_u": box_upper}
        table, lower, upper = matrices.A, bounds.lower[b:], bounds.upper[b:]
        absent = np.isinf(lower) & np.isinf(upper)
        if absent.any():
            # it writes a complaint to the terminal about every row without a bound
            table = np.where(absent[:, None], 0.0, table)
            lower, upper = np.where(absent, -1.0, lower), np.where(absent, 1.0, upper)
        fresh = fresh or not np.array_equal(absent, self._absent)
        self._absent = absent
        if len(lower):
            limits |= {"h_l": lower, "h_u": upper}
        rows = table if len(lower) else None
        if self._solver is None:
            self._solver = self._fresh()
            self._solver.setup(matrices.H, q, G=rows, **limits)
        elif fresh:
            self._solver.update(P=matrices.H, c=q, G=rows, **limits)
        else:
            self._solver.update(c=q, **limits)
        status = _ENDINGS.get(self._solver.solve(), QpStatus.FAILED)
        found = self._solver.result
        return Outcome(np.array(found.x, dtype=np.float64), status, int(found.info.iter))

    def _forget(self) -> None:
        self._solver = None

    def _fresh(self) -> piqp.DenseSolver:
        solver = piqp.DenseSolver()
        settings = solver.settings
        settings.eps_abs = settings.eps_rel = self._tolerance
        settings.check_duality_gap = True
        settings.eps_duality_gap_abs = settings.eps_duality_gap_rel = self._tolerance
        settings.max_iter = self._iterations
        settings.verbose = False
        return solver
