from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motionserver.solvers import hpipm_library
from motionserver.solvers.base import QpMatrices, QpStatus, QpVectors
from motionserver.solvers.registry import BACKENDS, make_backend, present

needs_hpipm = pytest.mark.skipif(not present("hpipm"), reason="needs the extra hpipm")


def programme(seed, n=12, m=20, b=8):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(n, n))
    matrices = QpMatrices(root @ root.T + np.eye(n), rng.normal(size=(m, n)))
    vectors = QpVectors(
        5.0 * rng.normal(size=n),
        np.full(m, -np.inf),
        rng.uniform(0.1, 1.0, m),
        np.full(b, -1.0),
        np.where(rng.random(b) < 0.5, 1.0, np.inf),
    )
    return vectors, matrices


def kkt_residual(x, vectors, matrices):
    """Least |stationarity| over multipliers of the right sign on the active bounds (NNLS)."""
    from scipy.optimize import nnls

    n = len(x)
    normals = [np.zeros(n)]
    for row, low, high in zip(matrices.A, vectors.lower, vectors.upper, strict=True):
        if row @ x > high - 1e-6:
            normals.append(row)
        if row @ x < low + 1e-6:
            normals.append(-row)
    for i, (low, high) in enumerate(zip(vectors.box_lower, vectors.box_upper, strict=True)):
        unit = np.eye(n)[i]
        if x[i] > high - 1e-6:
            normals.append(unit)
        if x[i] < low + 1e-6:
            normals.append(-unit)
    _, rest = nnls(np.array(normals).T, -(matrices.H @ x + vectors.q))
    return rest


class BackendContract:
    """Subclass with ``name`` and the accuracy the method promises."""

    name: str
    accuracy = 1e-4
    sound_when_cut_short = True

    @pytest.fixture
    def backend(self):
        return make_backend(self.name)

    def test_name(self, backend):
        assert backend.name == self.name

    def test_unconstrained_minimum_by_hand(self, backend):
        # min x^2 - 2x + 2y^2 - 8y: x = 1, y = 2
        vectors = QpVectors(
            np.array([-2.0, -8.0]), np.empty(0), np.empty(0), np.full(2, -np.inf), np.full(2, 9.0)
        )
        result = backend.solve(vectors, QpMatrices(np.diag([2.0, 4.0]), np.empty((0, 2))))
        assert result.status is QpStatus.SOLVED
        assert result.x == pytest.approx([1.0, 2.0], abs=10 * self.accuracy)

    def test_row_binds_by_hand(self, backend):
        # min (x^2 + y^2)/2 with x + y >= 2: x = y = 1
        vectors = QpVectors(
            np.zeros(2), np.array([2.0]), np.array([np.inf]), np.empty(0), np.empty(0)
        )
        result = backend.solve(vectors, QpMatrices(np.eye(2), np.ones((1, 2))))
        assert result.x == pytest.approx([1.0, 1.0], abs=10 * self.accuracy)

    def test_keeps_bounds(self, backend):
        for seed in range(5):
            vectors, matrices = programme(seed)
            x = make_backend(self.name).solve(vectors, matrices).x
            slack = 10 * self.accuracy
            assert (matrices.A @ x <= vectors.upper + slack).all()
            assert (x[:8] >= vectors.box_lower - slack).all()
            assert (x[:8] <= vectors.box_upper + slack).all()

    def test_vectors_alone_use_the_kept_matrices(self, backend):
        vectors, matrices = programme(1)
        backend.solve(vectors, matrices)
        other, _ = programme(2)
        again = backend.solve(other).x
        fresh = make_backend(self.name).solve(other, matrices).x
        assert again == pytest.approx(fresh, abs=20 * self.accuracy)

    def test_new_matrices_take_effect(self, backend):
        first, old = programme(1)
        backend.solve(first, old)
        vectors, matrices = programme(2)
        again = backend.solve(vectors, matrices).x
        fresh = make_backend(self.name).solve(vectors, matrices).x
        assert again == pytest.approx(fresh, abs=20 * self.accuracy)

    def test_only_rows_change(self, backend):
        vectors, matrices = programme(1)
        backend.solve(vectors, matrices)
        _, other = programme(2)
        mixed = QpMatrices(matrices.H, other.A)
        again = backend.solve(vectors, mixed).x
        fresh = make_backend(self.name).solve(vectors, mixed).x
        assert again == pytest.approx(fresh, abs=20 * self.accuracy)

    @pytest.mark.parametrize("where", ["q", "upper", "box_lower", "H", "A"])
    def test_not_a_number_is_a_status_and_heals(self, backend, where):
        vectors, matrices = programme(3)
        good = backend.solve(vectors, matrices).x
        poisoned = {f: np.array(getattr(vectors, f)) for f in vectors.__slots__}
        poisoned_m = {"H": np.array(matrices.H), "A": np.array(matrices.A)}
        (poisoned if where in poisoned else poisoned_m)[where].flat[0] = np.nan
        result = backend.solve(QpVectors(**poisoned), QpMatrices(**poisoned_m))
        assert result.status is QpStatus.FAILED
        healed = backend.solve(vectors, matrices).x
        assert healed == pytest.approx(good, abs=20 * self.accuracy)

    def test_infeasible_is_a_status_and_heals(self, backend):
        rows = QpMatrices(np.eye(2), np.array([[1.0, 0.0], [1.0, 0.0]]))
        nothing = np.empty(0)
        bad = QpVectors(
            np.zeros(2), np.array([1.0, -np.inf]), np.array([np.inf, -1.0]), nothing, nothing
        )
        result = backend.solve(bad, rows)
        assert result.status in (QpStatus.INFEASIBLE, QpStatus.BUDGET)
        good = QpVectors(
            np.zeros(2), np.array([1.0, -np.inf]), np.array([np.inf, 3.0]), nothing, nothing
        )
        assert backend.solve(good, rows).x == pytest.approx([1.0, 0.0], abs=10 * self.accuracy)

    def test_not_convex_is_a_status(self, backend):
        vectors, matrices = programme(3)
        result = backend.solve(vectors, QpMatrices(-matrices.H, matrices.A))
        assert result.status is not QpStatus.SOLVED or np.isfinite(result.x).all()

    def test_first_call_needs_matrices(self, backend):
        vectors, _ = programme(3)
        with pytest.raises(ValueError, match="matrices"):
            backend.solve(vectors)

    def test_size_is_fixed(self, backend):
        vectors, matrices = programme(3)
        backend.solve(vectors, matrices)
        with pytest.raises(ValueError, match="another size"):
            backend.solve(*programme(3, n=13))

    def test_budget(self):
        vectors, matrices = programme(5)
        backend = make_backend(self.name, iterations=1)
        result = backend.solve(vectors, matrices)
        assert result.status in (QpStatus.BUDGET, QpStatus.FAILED)
        assert result.iterations <= 1
        assert result.usable == (self.sound_when_cut_short and result.status is QpStatus.BUDGET)
        assert not result.usable or np.isfinite(result.x).all()

    def test_solved_is_usable_and_nothing_else_without_a_budget(self, backend):
        vectors, matrices = programme(4)
        assert backend.solve(vectors, matrices).usable
        poisoned = replace(vectors, q=np.full_like(vectors.q, np.nan))
        assert not backend.solve(poisoned).usable

    def test_rows_without_bounds_say_nothing_at_all(self, backend, capfd):
        vectors, matrices = programme(6)
        every = np.arange(len(vectors.upper))
        for kept in (every % 2 == 0, every % 3 == 0, every < 0, every >= 0):
            some = replace(vectors, upper=np.where(kept, vectors.upper, np.inf))
            left = QpMatrices(matrices.H, matrices.A[kept])
            only = replace(vectors, lower=vectors.lower[kept], upper=vectors.upper[kept])
            wanted = make_backend(self.name).solve(only, left).x
            for handed in (matrices, None):
                found = backend.solve(some, handed)
                assert found.x == pytest.approx(wanted, abs=20 * self.accuracy)
            backend.solve(vectors, None)
        assert capfd.readouterr() == ("", "")

    def test_bounds_that_cross_are_infeasible(self, backend):
        vectors, matrices = programme(4)
        crossed = replace(vectors, lower=vectors.upper + 1.0)
        result = backend.solve(crossed, matrices)
        assert result.status is QpStatus.INFEASIBLE
        assert not result.usable
        assert backend.solve(vectors).status is QpStatus.SOLVED

    def test_matrices_that_were_not_finite_were_not_taken(self, backend):
        vectors, matrices = programme(4)
        bad = QpMatrices(matrices.H, np.full_like(matrices.A, np.nan))
        assert backend.solve(vectors, bad).status is QpStatus.FAILED
        assert backend.solve(vectors).status is QpStatus.FAILED
        assert backend.solve(vectors, matrices).status is QpStatus.SOLVED


class TestDaqp(BackendContract):
    name = "daqp"
    sound_when_cut_short = False


class TestPiqp(BackendContract):
    name = "piqp"


@needs_hpipm
class TestHpipm(BackendContract):
    name = "hpipm"


class TestOsqp(BackendContract):
    name = "osqp"
    accuracy = 5e-3


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000))
def test_exact_backends_agree_and_are_optimal(seed):
    vectors, matrices = programme(seed)
    first = make_backend("daqp").solve(vectors, matrices)
    second = make_backend("piqp").solve(vectors, matrices)
    assert first.x == pytest.approx(second.x, abs=1e-4)
    assert kkt_residual(first.x, vectors, matrices) < 1e-6


def test_unknown_backend_names_the_known_ones():
    with pytest.raises(ValueError, match="daqp, osqp, piqp, hpipm"):
        make_backend("gurobi")


def test_a_missing_library_says_what_to_install(monkeypatch):
    monkeypatch.setattr(hpipm_library, "SHIPPED_BY", "no_such_package")
    hpipm_library.library.cache_clear()
    try:
        with pytest.raises(
            ValueError, match=r"no_such_package.*pip install 'motionserver\[hpipm\]'"
        ):
            make_backend("hpipm")
        assert not present("hpipm")
    finally:
        hpipm_library.library.cache_clear()


def test_a_budget_of_nothing_is_refused():
    with pytest.raises(ValueError, match="1 or more"):
        make_backend("piqp", iterations=0)


def test_registry_is_complete():
    there = [name for name in BACKENDS if present(name)]
    assert {make_backend(name).name for name in there} == set(there) >= {"daqp", "osqp", "piqp"}


@pytest.mark.parametrize("name", [name for name in BACKENDS if present(name)])
def test_a_hessian_changed_in_place_is_a_new_one(name):
    # the six-axis MPC fills one array again and again
    vectors, matrices = programme(4)
    backend = make_backend(name)
    backend.solve(vectors, matrices)
    matrices.H[:] = 3.0 * matrices.H + np.eye(len(matrices.H))
    again = backend.solve(vectors, matrices)
    fresh = make_backend(name).solve(vectors, matrices)
    assert again.x == pytest.approx(fresh.x, abs=2e-3)
