"""Fewer rows, the same optimum: beside a solver that sees all of them."""

from functools import partial

import numpy as np
import pytest

from motionserver.solvers.base import QpMatrices, QpStatus, QpVectors
from motionserver.solvers.registry import make_backend
from motionserver.solvers.screened import Screened


def programmes(seed, count=40, n=10, m=60):
    """A programme whose rows, bounds and cost drift from solve to solve."""
    rng = np.random.default_rng(seed)
    rows, room = rng.normal(size=(m, n)), rng.uniform(0.3, 3.0, m)
    root, cost = rng.normal(size=(n, n)), 4.0 * rng.normal(size=n)
    for _ in range(count):
        rows = rows + 0.05 * rng.normal(size=(m, n))
        room = np.clip(room + 0.1 * rng.normal(size=m), 0.05, 3.0)
        root = root + 0.02 * rng.normal(size=(n, n))
        cost = cost + 0.5 * rng.normal(size=n)
        lower = np.where(np.arange(m) % 3 == 0, -room, -np.inf)
        yield (
            QpVectors(cost, lower, room, np.full(2, -5.0), np.full(2, 5.0)),
            QpMatrices(root @ root.T + np.eye(n), rows),
        )


@pytest.mark.parametrize("name", ["daqp", "piqp"])
@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("kept", [6, 25])
def test_same_optimum_as_with_all_rows(name, seed, kept):
    screened = Screened(partial(make_backend, name), kept)
    for vectors, matrices in programmes(seed):
        wanted = make_backend(name).solve(vectors, matrices)
        found = screened.solve(vectors, matrices)
        assert found.status is QpStatus.SOLVED
        assert found.x == pytest.approx(wanted.x, abs=1e-5 if name == "daqp" else 2e-4)


def test_a_row_that_was_left_out_and_binds_is_found():
    # x = 3 is the optimum without the second row, which looks far: its room is 2, the first's 1
    screened = Screened(partial(make_backend, "daqp"), 1)
    vectors = QpVectors(
        np.array([-3.0]), np.full(2, -np.inf), np.array([1.0, 2.0]), np.empty(0), np.empty(0)
    )
    result = screened.solve(vectors, QpMatrices(np.eye(1), np.array([[-1.0], [1.0]])))
    assert result.x == pytest.approx([2.0])
    assert screened.widened == 1


def test_enough_rows_need_one_solve():
    screened = Screened(partial(make_backend, "daqp"), 25)
    for vectors, matrices in programmes(1):
        screened.solve(vectors, matrices)
    few = Screened(partial(make_backend, "daqp"), 6)
    for vectors, matrices in programmes(1):
        few.solve(vectors, matrices)
    assert screened.widened < few.widened


@pytest.mark.parametrize("where", ["near bound", "far bound", "near row", "far row", "cost"])
def test_what_is_no_number_is_no_solution(where):
    screened = Screened(partial(make_backend, "daqp"), 6)
    (vectors, matrices), *_ = programmes(2, 1)
    far = int(np.argmax(vectors.upper / np.linalg.norm(matrices.A, axis=1)))
    near = int(np.argmin(vectors.upper / np.linalg.norm(matrices.A, axis=1)))
    row = near if where.startswith("near") else far
    if where.endswith("bound"):
        vectors.upper[row] = np.nan
    elif where.endswith("row"):
        matrices.A[row, 0] = np.nan
    else:
        vectors.q[0] = np.nan
    result = screened.solve(vectors, matrices)
    assert not result.usable
    assert result.status is QpStatus.FAILED


def test_matrices_are_needed():
    (vectors, _), *_ = programmes(3, 1)
    with pytest.raises(ValueError, match="no matrices"):
        Screened(partial(make_backend, "daqp"), 6).solve(vectors)
