"""Stage programmes: what they are, and that HPIPM finds the condensed programme's optimum."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from stage_programmes import condensed, random_programme

from motionserver.solvers.base import QpStatus
from motionserver.solvers.piqp import Piqp
from motionserver.solvers.registry import present
from motionserver.solvers.stage import StageProgramme, make_stage, no_stages

needs_hpipm = pytest.mark.skipif(not present("hpipm"), reason="needs the extra hpipm")
seeds = st.integers(0, 10_000)


def solver(**options):
    from motionserver.solvers.hpipm import HpipmStages

    return HpipmStages(**options)


def exact():
    return solver(iterations=100, tolerance=1e-8, exact=True)


def cost(matrices, vectors, v):
    return 0.5 * v @ matrices.H @ v + vectors.q @ v


def best_slacks(programme, matrices, vectors, inputs):
    """Inputs with the least slacks that let them pass."""
    k = len(inputs)
    v = np.concatenate((inputs, np.zeros(len(vectors.q) - k)))
    for row, low, high in zip(matrices.A, vectors.lower, vectors.upper, strict=True):
        owned = np.flatnonzero(row[k:])
        if len(owned) and np.any(row[:k]):
            excess = max(low - row[:k] @ inputs, row[:k] @ inputs - high, 0.0)
            v[k + owned[0]] = max(v[k + owned[0]], excess)
    return v


def integrator(bound):
    """x' = x + u from 1, cost x'^2/2 + u^2/2, u at least -bound."""
    first, last = make_stage(1, 1, 1, 1), make_stage(1, 0, 0, 0)
    first.A[:], first.B[:], first.R[:], last.Q[:], first.D[:] = 1.0, 1.0, 1.0, 1.0, 1.0
    first.lower[:] = -bound
    return StageProgramme(np.ones(1), (first, last))


@needs_hpipm
def test_one_step_by_hand():
    # min (1 + u)^2/2 + u^2/2: u = -1/2, or the bound if that is nearer
    for bound, wanted in ((9.0, -0.5), (0.2, -0.2), (np.inf, -0.5)):
        result = exact().solve(integrator(bound))
        assert result.status is QpStatus.SOLVED
        assert result.inputs[0] == pytest.approx([wanted], abs=1e-6)


@needs_hpipm
def test_a_soft_row_by_hand():
    # as above with u >= 0 but soft: minus the price where -1/2 < u < 0; 1 + 2u = price
    programme = integrator(0.0)
    soft = replace(
        programme.stages[0],
        soft=np.zeros(1, dtype=np.intc),
        linear=np.array([0.4]),
        quadratic=np.zeros(1),
    )
    result = exact().solve(StageProgramme(programme.start, (soft, programme.stages[1])))
    assert result.inputs[0] == pytest.approx([-0.3], abs=1e-6)


@needs_hpipm
@settings(max_examples=60, deadline=None)
@given(seeds, st.integers(2, 7))
def test_the_optimum_is_that_of_the_condensed_programme(seed, stages):
    programme = random_programme(seed, stages)
    matrices, vectors, k = condensed(programme)
    reference = Piqp(200, 1e-9).solve(vectors, matrices)
    result = exact().solve(programme)
    assert result.status is QpStatus.SOLVED
    np.testing.assert_allclose(np.concatenate(result.inputs), reference.x[:k], atol=1e-4)


@needs_hpipm
@settings(max_examples=30, deadline=None)
@given(st.integers(0, 250))
def test_the_end_can_be_given(seed):
    # two bounds that are equal leave an interior point no interior: one in a thousand fails
    programme = random_programme(seed, terminal=True)
    matrices, vectors, _ = condensed(programme)
    result = exact().solve(programme)
    assert result.usable
    last, x = programme.stages[-1], programme.start
    for stage, u in zip(programme.stages[:-1], result.inputs, strict=False):
        x = stage.A @ x + stage.B @ u + stage.b
    np.testing.assert_allclose(last.C @ x, last.lower, atol=1e-4)
    best = cost(matrices, vectors, Piqp(200, 1e-9).solve(vectors, matrices).x)
    found = best_slacks(programme, matrices, vectors, np.concatenate(result.inputs))
    assert cost(matrices, vectors, found) == pytest.approx(best, rel=1e-3, abs=1e-2)


@needs_hpipm
@settings(max_examples=30, deadline=None)
@given(seeds, st.integers(1, 12))
def test_never_more_than_the_budget(seed, budget):
    result = solver(iterations=budget).solve(random_programme(seed))
    assert result.iterations <= budget
    assert result.usable == (result.status in (QpStatus.SOLVED, QpStatus.BUDGET))


@needs_hpipm
@settings(max_examples=30, deadline=None)
@given(seeds, st.booleans())
def test_refilled_in_place_is_as_good_as_new(seed, warm):
    first, second = random_programme(seed), random_programme(seed)
    kept = solver(iterations=100, tolerance=1e-8, exact=True, warm=warm)
    kept.solve(first)
    rng = np.random.default_rng(seed + 1)
    for old, new in zip(first.stages, second.stages, strict=True):
        for programme_stage in (old, new):
            programme_stage.q[:] = np.random.default_rng(seed + 2).normal(size=len(new.q))
        new.upper[:] = old.upper[:] = old.upper + rng.uniform(0.0, 0.5)
    again, fresh = kept.solve(first), exact().solve(second)
    np.testing.assert_allclose(
        np.concatenate(again.inputs), np.concatenate(fresh.inputs), atol=1e-4
    )


@needs_hpipm
@settings(max_examples=20, deadline=None)
@given(seeds)
def test_programmes_of_other_sizes_in_turn(seed):
    one, other = random_programme(seed, 3), random_programme(seed + 1, 4)
    kept = solver(iterations=100, tolerance=1e-8, exact=True, warm=False)
    wanted = np.concatenate(exact().solve(one).inputs)
    kept.solve(one)
    kept.solve(other)
    np.testing.assert_allclose(np.concatenate(kept.solve(one).inputs), wanted, atol=1e-9)


@needs_hpipm
@pytest.mark.parametrize("where", ["A", "b", "Q", "q", "R", "C", "upper", "linear"])
def test_not_a_number_is_a_status_and_heals(where):
    kept, programme = exact(), random_programme(0, hard=False)
    wanted = np.concatenate(kept.solve(programme).inputs)
    spoilt = getattr(programme.stages[1], where)
    good = spoilt.copy()
    spoilt.flat[0] = np.nan
    result = kept.solve(programme)
    assert not result.usable
    assert np.isnan(np.concatenate(result.inputs)).all()
    spoilt[:] = good
    np.testing.assert_allclose(np.concatenate(kept.solve(programme).inputs), wanted, atol=1e-6)


@needs_hpipm
def test_rows_that_cannot_be_met_are_infeasible_and_heal():
    programme = integrator(1.0)
    programme.stages[0].upper[:] = -2.0
    kept = exact()
    assert kept.solve(programme).status is QpStatus.INFEASIBLE
    last = make_stage(1, 0, 1, 0)
    last.C[:], last.lower[:] = 1.0, 5.0
    first = integrator(1.0).stages[0]
    first.upper[:] = 1.0
    beyond = StageProgramme(np.ones(1), (first, last))
    for tight in (kept, solver(iterations=8)):
        assert not tight.solve(beyond).usable
        last.lower[:] = 1.5
        assert tight.solve(beyond).usable
        last.lower[:] = 5.0


def test_shapes_are_checked():
    good = integrator(1.0)
    with pytest.raises(ValueError, match="two stages or more"):
        StageProgramme(np.zeros(2), good.stages)
    with pytest.raises(ValueError, match="stage 0: Q is"):
        StageProgramme(good.start, (replace(good.stages[0], Q=np.zeros((1, 2))), good.stages[1]))
    bad = replace(make_stage(2, 1, 0, 2), A=np.zeros((2, 2)).T[::-1])
    with pytest.raises(ValueError, match="in C order"):
        StageProgramme(np.zeros(2), (bad, make_stage(2, 0, 0, 0)))
    nothing, beyond = np.zeros(1), np.array([1], dtype=np.intc)
    bad = replace(good.stages[0], soft=beyond, linear=nothing, quadratic=nothing)
    with pytest.raises(ValueError, match="must rise"):
        StageProgramme(good.start, (bad, good.stages[1]))


def test_no_solution_has_the_shapes_of_one():
    result = no_stages(integrator(1.0))
    assert [len(part) for part in result.inputs] == [1, 0]
    assert not result.usable
