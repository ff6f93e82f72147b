"""The six-axis programme by stages: the same optimum for a solver that knows about dynamics.

One stage per piece of constant jerk; its state is what the plan differs from the nominal in pose,
velocity and acceleration at the piece's begin, its input the jerk's difference. The last two pieces
bring the plan to rest, so they follow from the state before them and belong to the last stage:
there is no condition at the end. Every row and every squared term of the condensed programme looks
at one instant, so it is a linear function of the stage in which that instant lies; which one, the
zeros of its coefficients tell.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from motionserver.core.axes import Array, frozen
from motionserver.cueing.mpc_cost import JERK, Cost
from motionserver.cueing.mpc_grid import SplineGrid, jerk_maps
from motionserver.solvers.base import INFINITE, QpBackend, QpMatrices, QpResult, QpVectors
from motionserver.solvers.registry import STAGED, make_backend, make_stage_backend
from motionserver.solvers.screened import Screened
from motionserver.solvers.stage import Stage, StageBackend, StageProgramme, make_stage

JERK_UNIT: Final = 10.0
"""Unit of the inputs [m/s3, rad/s3]: with it they are of the size of the states."""
TOLERANCE: Final = 1e-5
"""Of an inexact method; at 1e-3 it was measured to leave nearly all of the cue away."""
_STATES: Final = 18
_AXES: Final = 6
_SPARE: Final = 6
"""Rows kept free in a stage when rows wander in from others."""


@dataclass(frozen=True, slots=True)
class _Place:
    """Where the slacks of a stage are among its inputs."""

    tilts: np.ndarray
    inputs: int


def make_solver(
    name: str, grid: SplineGrid, cost: Cost, iterations: int | None = None
) -> QpBackend:
    """Solver of the condensed programme: dense, or by stages where the method is made for those.

    Args:
        name: Backend, see `solvers.registry`.
        grid: The grid of plans.
        cost: What fills the programme's cost.
        iterations: Fixed budget of iterations; None is the backend's own.

    Raises:
        ValueError: There is no such backend, or its library is not there.
    """
    dense = Screened(partial(make_backend, name, iterations, TOLERANCE))
    if name not in STAGED:
        return dense
    return StagedProgramme(grid, cost, make_stage_backend(name, iterations), dense)


class StagedProgramme:
    """Turns the condensed programme into stages and solves those.

    Variables of the condensed programme: the legs' slack, a slack of tilt rate per piece, then the
    coefficients, axis by axis.

    Args:
        grid: The grid of plans.
        cost: What fills the programme's cost, asked for its factor at each solve.
        backend: Solver of the stages.
        dense: Solver for a cost that cannot be told by stages.
    """

    def __init__(
        self, grid: SplineGrid, cost: Cost, backend: StageBackend, dense: QpBackend
    ) -> None:
        slacks = 1 + grid.pieces
        self.name, self._dense = backend.name, dense
        self._grid, self._cost, self._backend, self._slacks = grid, cost, backend, slacks
        self.count = count = grid.pieces - 2
        begins = jerk_maps(grid.edges, grid.edges[:count]).of(grid.basis)
        # pose, velocity, acceleration at the begin and jerk of each stage, by the coefficients
        stages = np.stack(
            (begins.pose, begins.velocity, begins.acceleration, grid.basis[:count]), axis=1
        )
        self._to_stage = [frozen(np.linalg.pinv(one, rcond=1e-12)) for one in stages]
        self._to_coefficients = frozen(np.linalg.inv(grid.basis[:count]))
        self._at = np.minimum(grid.piece, count - 1)
        self._node_parts = [
            slice(*np.searchsorted(self._at, (stage, stage + 1))) for stage in range(count)
        ]
        tilts = np.minimum(np.arange(slacks - 1), count - 1)
        self._places = [
            _Place(
                np.flatnonzero(tilts == stage),
                _AXES + int((tilts == stage).sum()) + int(stage == 0),
            )
            for stage in range(count)
        ]
        self._at_nodes = frozen(np.stack([self._to_stage[stage] for stage in self._at]))
        self._constant = np.zeros((count, 4 * _AXES, 4 * _AXES))
        self._capacity = np.zeros(count, dtype=int)
        self._prices = np.zeros((3, 6))
        self._programme: StageProgramme | None = None

    def _weigh(self, prices: Array) -> None:
        """Take the constant part of the cost."""
        if prices is self._prices:
            return
        self._prices = prices
        grid, maps = self._grid, self._grid.at_nodes
        self._constant[:] = 0.0
        for price, gains in zip(prices, (maps.pose, maps.velocity, maps.acceleration), strict=True):
            for gain, stage, share in zip(gains, self._at, grid.share, strict=True):
                one = gain @ self._to_stage[stage]
                self._constant[stage] += np.kron(share * np.outer(one, one), np.diag(price))
        for piece, (gain, length) in enumerate(zip(grid.basis, np.diff(grid.edges), strict=True)):
            stage = min(piece, self.count - 1)
            one = gain @ self._to_stage[stage]
            self._constant[stage] += np.kron(length * np.outer(one, one), np.diag(JERK))

    def solve(self, vectors: QpVectors, matrices: QpMatrices | None = None) -> QpResult:
        """Solve the condensed programme by stages; see `QpBackend.solve`.

        Of H only what concerns the slacks is read, the rest comes from the cost's factor. The
        matrices are needed every time.
        """
        if matrices is None:
            raise ValueError("six-axis MPC by stages: got no matrices; pass them at every solve")
        factor = self._cost.factor
        if factor is None:
            return self._dense.solve(vectors, matrices)
        self._weigh(self._cost.prices)
        order, stages = self._sorted_rows(vectors, matrices.A)
        programme = self._sized(np.bincount(stages, minlength=self.count))
        self._fill_cost(programme, vectors.q, matrices.H, factor)
        self._fill_rows(programme, vectors, matrices.A, order, stages)
        result = self._backend.solve(programme)
        x = np.full(len(vectors.q), np.nan)
        if result.usable:
            self._unstack(result.inputs, x)
        return QpResult(x, result.status, result.iterations, result.usable)

    def _unstack(self, inputs: tuple[Array, ...], x: Array) -> None:
        x[0] = inputs[0][-1]
        for place, one in zip(self._places, inputs, strict=True):
            x[1 + place.tilts] = one[_AXES : _AXES + len(place.tilts)]
        jerks = JERK_UNIT * np.stack([one[:_AXES] for one in inputs])
        x[self._slacks :] = (self._to_coefficients @ jerks).T.ravel()

    def _sorted_rows(self, vectors: QpVectors, rows: Array) -> tuple[np.ndarray, np.ndarray]:
        """Rows that say something, by stage, and the stage of each."""
        bounded = (vectors.upper < INFINITE) | (vectors.lower > -INFINITE)
        used = (rows[:, self._slacks :].reshape(len(rows), _AXES, -1) != 0.0).any(axis=1)
        last = self.count - 1 - np.argmax(used[:, ::-1], axis=1)
        order = np.flatnonzero(bounded & used.any(axis=1))
        order = order[np.argsort(last[order], kind="stable")]
        return order, last[order]

    def _sized(self, needed: np.ndarray) -> StageProgramme:
        """The programme kept, or a new one where rows have wandered into a stage."""
        if self._programme is None or (needed > self._capacity).any():
            spare = 0 if self._programme is None else _SPARE
            self._capacity = np.where(needed > self._capacity, needed + spare, self._capacity)
            self._programme = StageProgramme(
                np.zeros(_STATES), tuple(self._stage(stage) for stage in range(self.count))
            )
        return self._programme

    def _stage(self, number: int) -> Stage:
        place = self._places[number]
        # the legs' slack is an input of the first stage and a state of all others
        states = _STATES + int(number > 0)
        after = 0 if number == self.count - 1 else _STATES + 1
        slacks = place.inputs - _AXES
        stage = make_stage(states, place.inputs, int(self._capacity[number]) + slacks, after)
        if after:
            length = float(np.diff(self._grid.edges)[number])
            eye = np.eye(_AXES)
            step = np.array([[1.0, length, length**2 / 2.0], [0.0, 1.0, length], [0.0, 0.0, 1.0]])
            push = np.array([length**3 / 6.0, length**2 / 2.0, length])
            stage.A[:_STATES, :_STATES] = np.kron(step, eye)
            stage.B[:_STATES, :_AXES] = JERK_UNIT * np.kron(push[:, None], eye)
            if number == 0:
                stage.B[_STATES, -1] = 1.0
            else:
                stage.A[_STATES, _STATES] = 1.0
        if slacks:
            stage.D[:slacks, _AXES:] = np.eye(slacks)
            stage.lower[:slacks] = 0.0
        return stage

    def _fill_cost(
        self, programme: StageProgramme, linear: Array, hessian: Array, factor: Array
    ) -> None:
        count, slacks = self.count, self._slacks
        price, curvature = linear[:slacks], np.diagonal(hessian)[:slacks]
        # a linear cost of the coefficients is one of the jerks that they are made of
        pull = self._to_coefficients.T @ linear[slacks:].reshape(_AXES, count).T
        felt = np.matmul(factor.reshape(len(factor), -1, count), self._at_nodes)
        felt = felt.reshape(-1, _AXES, 4).swapaxes(1, 2).reshape(len(factor), -1, 4 * _AXES)
        for number, stage in enumerate(programme.stages):
            place = self._places[number]
            part = felt[self._node_parts[number]].reshape(-1, 4 * _AXES)
            squares = part.T @ part
            squares += self._constant[number]
            stage.Q[:_STATES, :_STATES] = squares[:_STATES, :_STATES]
            stage.S[:_AXES, :_STATES] = JERK_UNIT * squares[_STATES:, :_STATES]
            stage.R[:_AXES, :_AXES] = JERK_UNIT**2 * squares[_STATES:, _STATES:]
            stage.r[:_AXES] = JERK_UNIT * pull[number]
            ends = _AXES + len(place.tilts)
            tilts = np.arange(_AXES, ends)
            stage.R[tilts, tilts] = curvature[1 + place.tilts]
            stage.r[tilts] = price[1 + place.tilts]
            if number == 0:
                stage.R[-1, -1] = curvature[0]
                stage.r[-1] = price[0]

    def _fill_rows(
        self,
        programme: StageProgramme,
        vectors: QpVectors,
        rows: Array,
        order: np.ndarray,
        stages: np.ndarray,
    ) -> None:
        count, slacks = self.count, self._slacks
        ends = np.searchsorted(stages, np.arange(count + 1))
        rows, lower, upper = rows[order], vectors.lower[order], vectors.upper[order]
        for number, stage in enumerate(programme.stages):
            place = self._places[number]
            first = place.inputs - _AXES
            chosen = slice(ends[number], ends[number + 1])
            part = rows[chosen]
            here = slice(first, first + len(part))
            look = part[:, slacks:].reshape(-1, count) @ self._to_stage[number]
            look = look.reshape(-1, _AXES, 4).swapaxes(1, 2).reshape(-1, 4 * _AXES)
            stage.C[here, :_STATES] = look[:, :_STATES]
            stage.D[here, :_AXES] = JERK_UNIT * look[:, _STATES:]
            stage.D[here, _AXES : _AXES + len(place.tilts)] = part[:, 1 + place.tilts]
            if number:
                stage.C[here, _STATES] = part[:, 0]
            else:
                stage.D[here, -1] = part[:, 0]
            stage.lower[here], stage.upper[here] = lower[chosen], upper[chosen]
            stage.lower[here.stop :], stage.upper[here.stop :] = -np.inf, np.inf
