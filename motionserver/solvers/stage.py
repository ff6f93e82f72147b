"""Quadratic programmes by stages: linear dynamics, a quadratic cost and rows at every stage.

The same plan as a condensed programme gives, but its cost grows with the number of stages, not
with its cube. Sizes may differ from stage to stage, so a variable that is shared by several (one
slack for all) is an input of the first stage carried along as a state.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Final, Protocol

import numpy as np

from motionserver.core.axes import Array
from motionserver.solvers.base import QpStatus

_MATRICES: Final = ("A", "B", "Q", "S", "R", "C", "D")


@dataclass(frozen=True, slots=True)
class Stage:
    """One stage of n states, k inputs and g rows, followed by one of n' states.

    min 1/2 x'Qx + u'Sx + 1/2 u'Ru + q'x + r'u, with x' = A x + B u + b and
    lower <= C x + D u <= upper. A soft row may be exceeded on either side by a slack s >= 0 of its
    own at the price linear s + 1/2 quadratic s^2. Equal bounds leave an interior-point method no
    interior: better put what they say into the dynamics. Arrays are float64, in C order, and may be
    written to between solves; so they may be views of stacks that are filled at once.

    Attributes:
        A: (n', n); n' = 0 at the last stage.
        B: (n', k).
        b: (n',).
        Q: (n, n), symmetric.
        S: (k, n).
        R: (k, k), symmetric; positive definite where k > 0.
        q: (n,).
        r: (k,).
        C: (g, n).
        D: (g, k).
        lower: (g,); beyond `INFINITE` there is no bound.
        upper: (g,).
        soft: Which rows are soft, ascending, (s,) integers.
        linear: Price of a slack, (s,).
        quadratic: Price of its square, (s,).
    """

    A: Array
    B: Array
    b: Array
    Q: Array
    S: Array
    R: Array
    q: Array
    r: Array
    C: Array
    D: Array
    lower: Array
    upper: Array
    soft: Array
    linear: Array
    quadratic: Array

    @property
    def sizes(self) -> tuple[int, int, int]:
        """States, inputs and rows."""
        return len(self.q), len(self.r), len(self.lower)


def make_stage(states: int, inputs: int, rows: int, after: int, soft: Sequence[int] = ()) -> Stage:
    """A stage of zeros to be filled in; no row has a bound.

    Args:
        states: n.
        inputs: k.
        rows: g.
        after: States of the next stage; 0 for the last one.
        soft: Which rows are soft.
    """
    n, k, g, s = states, inputs, rows, len(soft)
    return Stage(
        np.zeros((after, n)),
        np.zeros((after, k)),
        np.zeros(after),
        np.zeros((n, n)),
        np.zeros((k, n)),
        np.zeros((k, k)),
        np.zeros(n),
        np.zeros(k),
        np.zeros((g, n)),
        np.zeros((g, k)),
        np.full(g, -np.inf),
        np.full(g, np.inf),
        np.asarray(soft, dtype=np.intc),
        np.zeros(s),
        np.zeros(s),
    )


@dataclass(frozen=True, slots=True)
class StageProgramme:
    """Stages one after the other from a state that is given.

    Attributes:
        start: State at the first stage, (n,).
        stages: All of them, two at least; the last one without dynamics.

    Raises:
        ValueError: Shapes that do not fit together, or arrays a solver cannot read in place.
    """

    start: Array
    stages: tuple[Stage, ...]

    def __post_init__(self) -> None:
        if len(self.stages) < 2 or len(self.start) != self.stages[0].sizes[0]:
            raise ValueError(
                f"stage programme: {len(self.stages)} stages from a state of {len(self.start)}; "
                "allowed are two stages or more, the first with as many states as the start has"
            )
        afters = [stage.sizes[0] for stage in self.stages[1:]] + [0]
        for number, (stage, after) in enumerate(zip(self.stages, afters, strict=True)):
            _check(stage, number, after)


def _check(stage: Stage, number: int, after: int) -> None:
    n, k, g = stage.sizes
    s = len(stage.soft)
    wanted = {
        "A": (after, n), "B": (after, k), "b": (after,), "Q": (n, n), "S": (k, n), "R": (k, k),
        "q": (n,), "r": (k,), "C": (g, n), "D": (g, k), "lower": (g,), "upper": (g,),
        "soft": (s,), "linear": (s,), "quadratic": (s,),
    }  # fmt: skip
    for item in fields(stage):
        array = getattr(stage, item.name)
        kind = np.dtype(np.intc if item.name == "soft" else np.float64)
        if array.shape != wanted[item.name] or array.dtype != kind or not array.flags.c_contiguous:
            raise ValueError(
                f"stage {number}: {item.name} is {array.dtype} of shape {array.shape}; allowed is "
                f"{kind} of shape {wanted[item.name]} in C order"
            )
    rising = (np.diff(stage.soft) > 0).all() and ((stage.soft >= 0) & (stage.soft < g)).all()
    if not rising:
        raise ValueError(f"stage {number}: soft rows {stage.soft} must rise and be below {g}")


@dataclass(frozen=True, slots=True)
class StageResult:
    """What a stage backend found; see `QpResult`.

    Attributes:
        inputs: Of each stage, (k,) each; NaN where there is no solution. States follow from them
            by the dynamics.
        status: How it ended.
        iterations: Iterations used.
        usable: Whether ``inputs`` may be offered as a plan.
    """

    inputs: tuple[Array, ...]
    status: QpStatus
    iterations: int
    usable: bool


class StageBackend(Protocol):
    """A solver for stage programmes. Numbers never raise; see `QpBackend`.

    It reads a programme's arrays in place: handing over the very same programme with other numbers
    in it costs least. Programmes of the same sizes reuse memory and warm-start each other.
    """

    name: str

    def solve(self, programme: StageProgramme) -> StageResult:
        """Solve.

        Args:
            programme: What to solve.

        Returns:
            The result, whatever the numbers.
        """
        ...


def no_stages(
    programme: StageProgramme, status: QpStatus = QpStatus.FAILED, iterations: int = 0
) -> StageResult:
    """A result that says there is none."""
    inputs = tuple(np.full(stage.sizes[1], np.nan) for stage in programme.stages)
    return StageResult(inputs, status, iterations, usable=False)
