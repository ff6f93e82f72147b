"""HPIPM: interior point over stages (Frison and Diehl, IFAC 2020), within a fixed budget."""

from __future__ import annotations

from typing import ClassVar, Final

import numpy as np

from motionserver.core.axes import Array
from motionserver.solvers.base import QpMatrices, QpStatus
from motionserver.solvers.dense import Bounds, DenseBackend, Outcome
from motionserver.solvers.hpipm_library import library
from motionserver.solvers.hpipm_memory import Memory, sizes_of
from motionserver.solvers.stage import StageProgramme, StageResult, make_stage, no_stages

_ENDINGS: Final = {0: QpStatus.SOLVED, 1: QpStatus.BUDGET}
_BROKEN: Final = 1e-2
"""If rows are still broken by this much they could not be met: scale rows so that 1 means a full
limit."""


class HpipmStages:
    """Solves stage programmes in memory that is made once per set of sizes.

    Args:
        iterations: Budget; the cost of an iteration is constant.
        tolerance: At which it is solved: residuals and complementarity.
        warm: Begin at the last solution's states and inputs: measured to bring nothing here.
        exact: Take the mode that looks for accuracy. The one for speed takes a third less time,
            but gets no better than 1e-7 and worsens from there.
        barrier: Complementarity it begins with: of the size of prices times slacks.

    Raises:
        HpipmMissingError: The library is not there.
    """

    name = "hpipm"

    def __init__(
        self,
        iterations: int = 8,
        tolerance: float = 1e-6,
        warm: bool = False,
        exact: bool = False,
        barrier: float = 1.0,
    ) -> None:
        self._options = (iterations, tolerance, exact, barrier)
        self._warm = warm
        self._memory: Memory | None = None
        self._programme: StageProgramme | None = None
        self._warmed = False
        # stumble over a missing library now, not at the first solve
        library()

    def solve(self, programme: StageProgramme) -> StageResult:
        """Solve; see `StageBackend.solve`."""
        memory = self._bound(programme)
        if not _put_in_start(programme, memory):
            return no_stages(programme)
        if (memory.lower > memory.upper).any():
            return no_stages(programme, QpStatus.INFEASIBLE)
        memory.hand_over()
        code, iterations = memory.run(self._warm and self._warmed)
        inputs = memory.inputs()
        status = _ENDINGS.get(code, QpStatus.FAILED)
        if not np.isfinite(np.concatenate(inputs)).all():
            status = QpStatus.FAILED
        elif not memory.broken() <= _BROKEN:
            status = QpStatus.INFEASIBLE
        self._warmed = status in (QpStatus.SOLVED, QpStatus.BUDGET)
        if not self._warmed:
            # what is not a number would stay in the library's memory for ever
            self._memory = self._programme = None
            return no_stages(programme, status, iterations)
        return StageResult(inputs, status, iterations, usable=True)

    def _bound(self, programme: StageProgramme) -> Memory:
        if programme is self._programme and self._memory is not None:
            return self._memory
        sizes = sizes_of(programme)
        if self._memory is None or self._memory.sizes != sizes:
            self._memory = Memory(sizes, *self._options)
            self._warmed = False
        self._memory.bind(programme)
        self._programme = programme
        return self._memory


class Hpipm(DenseBackend):
    """A dense programme as one stage without states, for programmes that come condensed.

    Its method takes far more time for that than `HpipmStages` for the same plan in stages.
    """

    name: ClassVar[str] = "hpipm"
    no_bound: ClassVar[float] = np.inf
    cut_short_usable: ClassVar[bool] = True

    def __init__(self, iterations: int = 60, tolerance: float = 1e-8) -> None:
        super().__init__()
        self._stages = HpipmStages(iterations, tolerance, warm=False, exact=True)
        self._programme: StageProgramme | None = None

    def _run(self, q: Array, bounds: Bounds, matrices: QpMatrices, fresh: bool) -> Outcome:
        n, b = len(q), bounds.box
        if self._programme is None:
            stage = make_stage(0, n, len(bounds.lower), 0)
            stage.D[:b] = np.eye(b, n)
            # the library wants a stage after it, be it empty
            self._programme = StageProgramme(np.zeros(0), (stage, make_stage(0, 0, 0, 0)))
            fresh = True
        stage = self._programme.stages[0]
        if fresh:
            stage.R[:], stage.D[b:] = matrices.H, matrices.A
        stage.r[:], stage.lower[:], stage.upper[:] = q, bounds.lower, bounds.upper
        result = self._stages.solve(self._programme)
        return Outcome(result.inputs[0], result.status, result.iterations)

    def _forget(self) -> None:
        self._programme = None


def _put_in_start(programme: StageProgramme, memory: Memory) -> bool:
    """Write what depends on the state at the start; False if a bound is not a number."""
    stages, start = programme.stages, programme.start
    first = stages[0]
    np.concatenate([stage.lower for stage in stages], out=memory.lower)
    np.concatenate([stage.upper for stage in stages], out=memory.upper)
    known = first.C @ start
    memory.lower[: len(known)] -= known
    memory.upper[: len(known)] -= known
    memory.first_b[:] = first.b + first.A @ start
    memory.first_r[:] = first.r + first.S @ start
    return not bool(np.isnan(memory.lower).any() or np.isnan(memory.upper).any())
