"""DAQP: exact dual active-set method for dense programmes; the default."""

from __future__ import annotations

from typing import ClassVar, Final

import daqp
import numpy as np

from motionserver.core.axes import Array
from motionserver.solvers.base import QpMatrices, QpStatus
from motionserver.solvers.dense import Bounds, DenseBackend, Outcome

_ENDINGS: Final = {-1: QpStatus.INFEASIBLE, -4: QpStatus.BUDGET}


class Daqp(DenseBackend):
    """One kept ``Model``, updated in place; rebuilt after any failure.

    Iterates are worthless before the optimum: of a budget of 5 iterations 55 % of steps were
    measured to break a limit, by up to nine times its size. So BUDGET is not usable here.
    """

    name: ClassVar[str] = "daqp"
    no_bound: ClassVar[float] = 1e30
    cut_short_usable: ClassVar[bool] = False

    def __init__(self, iterations: int = 400) -> None:
        super().__init__()
        self._iterations = iterations
        self._model: daqp.Model | None = None
        self._last_h: Array | None = None
        self._set_h: Array | None = None

    def _keep(self, matrices: QpMatrices) -> QpMatrices:
        # only what nobody can write to is surely what it was; it takes no read-only arrays itself
        same = matrices.H is self._last_h and not matrices.H.flags.writeable
        kept = self._matrices if same else None
        self._last_h = matrices.H
        if not same:
            self._set_h = None
        return QpMatrices(
            kept.H if kept is not None else np.require(matrices.H, np.float64, ["C", "W"]),
            np.require(matrices.A, np.float64, ["C", "W"]),
        )

    def _run(self, q: Array, bounds: Bounds, matrices: QpMatrices, fresh: bool) -> Outcome:
        q = np.require(q, np.float64, ["C", "W"])
        if self._model is None:
            flag = self._set_up(q, bounds, matrices)
        elif fresh:
            h = None if matrices.H is self._set_h else matrices.H
            flag = self._model.update(
                H=h, A=matrices.A, f=q, bupper=bounds.upper, blower=bounds.lower
            )
        else:
            flag = self._model.update(f=q, bupper=bounds.upper, blower=bounds.lower)
        self._set_h = matrices.H
        if flag < 0 or self._model is None:
            return Outcome(None, _ENDINGS.get(flag, QpStatus.FAILED))
        x, _, flag, info = self._model.solve()
        status = QpStatus.SOLVED if flag > 0 else _ENDINGS.get(flag, QpStatus.FAILED)
        if status is not QpStatus.SOLVED:
            # its working set may be unsound now
            self._forget()
        return Outcome(x, status, int(info["iterations"]))

    def _set_up(self, q: Array, bounds: Bounds, matrices: QpMatrices) -> int:
        model = daqp.Model()
        model.settings = {"iter_limit": self._iterations}
        flag, _ = model.setup(matrices.H, q, matrices.A, bounds.upper, bounds.lower)
        self._model = model if flag >= 0 else None
        return int(flag)

    def _forget(self) -> None:
        self._model = None
