"""What a QP backend is: one dense quadratic programme, solved again and again."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final, Protocol

import numpy as np

from motionserver.core.axes import Array

INFINITE: Final = 1e20
"""A bound of at least this size is no bound; `inf` works too."""


class QpStatus(StrEnum):
    """How a solve ended."""

    SOLVED = "solved"
    BUDGET = "budget"
    INFEASIBLE = "infeasible"
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class QpResult:
    """What a backend found.

    Attributes:
        x: The minimiser, (n,); the last iterate after BUDGET, NaN where there is none.
        status: SOLVED; BUDGET (iterations used up); INFEASIBLE; FAILED (anything else).
        iterations: Iterations used.
        usable: Whether ``x`` may be offered as a plan: finite, and solved or the iterate of a
            method that is sound when cut short. Whether it keeps every limit is for the caller's
            own check to say.
    """

    x: Array
    status: QpStatus
    iterations: int
    usable: bool


@dataclass(frozen=True, slots=True)
class QpMatrices:
    """The part of a programme that rarely changes: min 1/2 x'Hx + q'x, l <= Ax <= u, box.

    Attributes:
        H: Positive definite, (n, n).
        A: Rows, (m, n); m may be 0.
    """

    H: Array
    A: Array


@dataclass(frozen=True, slots=True)
class QpVectors:
    """The part that changes every time.

    Attributes:
        q: Linear cost, (n,).
        lower: Lower bounds of the rows, (m,).
        upper: Upper bounds of the rows, (m,).
        box_lower: Lower bounds of the first variables, (b,), b <= n.
        box_upper: Upper bounds of the first variables, (b,).
    """

    q: Array
    lower: Array
    upper: Array
    box_lower: Array
    box_upper: Array


class QpBackend(Protocol):
    """A solver for one programme whose size stays fixed.

    ``solve`` may be called for ever after; matrices handed over once stay in force until others
    are; the very same H handed over again is taken as unchanged if nobody can write to it. The last
    solution warm-starts the next one where the method allows it. Numbers never raise: not finite,
    infeasible, ill-conditioned ones come back as a status.

    Every backend takes a fixed budget of iterations. What is left when it is used up differs: an
    interior-point iterate (piqp, hpipm) lies inside the inequalities once a full step has been
    made, so a few iterations short of the optimum it is a plan a little too timid; an iterate of
    operator splitting (osqp) may break bounds by a few thousandths; an active set (daqp) short of
    the optimum is no plan at all. `QpResult.usable` says so.
    """

    name: str

    def solve(self, vectors: QpVectors, matrices: QpMatrices | None = None) -> QpResult:
        """Solve.

        Args:
            vectors: Cost and bounds of this time.
            matrices: New matrices of the same shapes; None keeps the last ones. The first call
                needs them.

        Returns:
            The result, whatever the numbers.

        Raises:
            ValueError: The first call came without matrices, or shapes changed.
        """
        ...


def no_solution(size: int, status: QpStatus = QpStatus.FAILED, iterations: int = 0) -> QpResult:
    """A result that says there is none."""
    return QpResult(np.full(size, np.nan), status, iterations, usable=False)


def finite(vectors: QpVectors, matrices: QpMatrices | None) -> bool:
    """Whether costs and matrices are finite and no bound is NaN."""
    bounds = (vectors.lower, vectors.upper, vectors.box_lower, vectors.box_upper)
    return (
        bool(np.isfinite(vectors.q).all())
        and not any(bool(np.isnan(b).any()) for b in bounds)
        and (
            matrices is None
            or bool(np.isfinite(matrices.H).all() and np.isfinite(matrices.A).all())
        )
    )


def checked_shapes(
    vectors: QpVectors, matrices: QpMatrices | None, known: tuple[int, int, int] | None
) -> tuple[int, int, int]:
    """Sizes (n, m, b) of a programme.

    Raises:
        ValueError: No matrices yet, shapes that do not fit together, or that changed.
    """
    if matrices is None and known is None:
        raise ValueError("qp: the first solve needs matrices H and A; got none, pass QpMatrices")
    n, m, b = len(vectors.q), len(vectors.lower), len(vectors.box_lower)
    fits = len(vectors.upper) == m and len(vectors.box_upper) == b and b <= n
    if matrices is not None:
        fits = fits and matrices.H.shape == (n, n) and matrices.A.shape == (m, n)
    if not fits or (known is not None and known != (n, m, b)):
        raise ValueError(
            f"qp: n={n}, m={m}, box={b} do not fit together or differ from {known}; "
            "make a new backend for a programme of another size"
        )
    return n, m, b
