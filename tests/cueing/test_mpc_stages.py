"""The six-axis programme by stages has the optimum of the condensed one, and drives like it."""

from dataclasses import replace

import numpy as np
import pytest

from motionserver.cueing.mpc import SixAxis
from motionserver.cueing.mpc_stages import StagedProgramme, make_solver
from motionserver.cueing.registry import make_cueing
from motionserver.cueing.tuning import Tuning
from motionserver.evaluate.bench.plan_steps import LIVELY, PERIOD, time_plans
from motionserver.settings.machine import load_machine
from motionserver.solvers.base import QpStatus
from motionserver.solvers.registry import REFERENCE, make_backend, present

pytestmark = pytest.mark.skipif(not present("hpipm"), reason="needs the extra hpipm")
MACHINE = load_machine("t2-compact")
MPC = replace(Tuning(), algorithm="mpc")


class Tapped:
    """Drives with the reference and asks the stages the same."""

    name = "tapped"

    def __init__(self, staged):
        self.staged, self.best, self.pairs = staged, make_backend(REFERENCE), []

    def solve(self, vectors, matrices=None):
        best, found = (each.solve(vectors, matrices) for each in (self.best, self.staged))
        self.pairs.append((best, found, vectors, matrices.H.copy(), matrices.A.copy()))
        return best


def tap(pieces, ticks, iterations, tuning=MPC):
    from motionserver.solvers.hpipm import HpipmStages

    tapped = []

    def make(machine, chosen, period):
        mpc = SixAxis(machine, chosen, period, pieces=pieces)
        staged = StagedProgramme(
            mpc._grid, mpc._cost, HpipmStages(iterations, 1e-9, exact=True), None
        )
        tapped.append(Tapped(staged))
        mpc._backend = tapped[0]
        return mpc

    times = time_plans(MACHINE, tuning, ticks, paced=False, make=make, begin=LIVELY)
    assert times.outcomes["no plan"] == 0
    return tapped[0].pairs


def cost(x, vectors, hessian):
    return 0.5 * x @ hessian @ x + vectors.q @ x


TIGHT = replace(MPC, box=0.1 * MACHINE.box)


@pytest.mark.parametrize(
    ("pieces", "tuning"), [(6, MPC), (15, MPC), (20, MPC), (15, TIGHT), (15, replace(MPC, gain=1))]
)
def test_the_optimum_is_that_of_the_condensed_programme(pieces, tuning):
    for best, found, vectors, hessian, rows in tap(pieces, 15, 60, tuning):
        assert found.status is QpStatus.SOLVED
        scale = 1.0 + abs(cost(best.x, vectors, hessian))
        assert cost(found.x, vectors, hessian) == pytest.approx(
            cost(best.x, vectors, hessian), abs=1e-6 * scale
        )
        assert (rows @ found.x <= vectors.upper + 1e-6).all()
        assert (rows @ found.x >= vectors.lower - 1e-6).all()
        np.testing.assert_allclose(found.x, best.x, atol=2e-3)


def test_eight_iterations_keep_the_rows():
    for _, found, vectors, _, rows in tap(15, 15, 8):
        assert found.usable
        assert (rows @ found.x <= vectors.upper + 1e-4).all()


def test_it_drives_like_the_optimum():
    drives = [
        time_plans(MACHINE, replace(MPC, backend=name), 40, paced=False, begin=LIVELY)
        for name in ("hpipm", "piqp")
    ]
    assert drives[0].outcomes["no plan"] == drives[0].outcomes["refused"] == 0
    assert drives[0].force_rmse() == pytest.approx(drives[1].force_rmse(), rel=0.01)


def test_a_cost_that_mixes_instants_is_solved_all_the_same():
    tuning = replace(MPC, perception="telban-cardullo")
    drives = [
        time_plans(MACHINE, replace(tuning, backend=name), 15, paced=False, begin=LIVELY)
        for name in ("hpipm", "piqp")
    ]
    assert drives[0].outcomes["no plan"] == 0
    assert drives[0].force_rmse() == pytest.approx(drives[1].force_rmse(), rel=0.01)


def test_other_weights_take_effect():
    mpc = make_cueing(MACHINE, replace(MPC, backend="hpipm"), PERIOD)
    before = mpc._backend
    mpc.retune(replace(MPC, backend="hpipm", mpc_weight_position=3.0))
    assert mpc._backend is before
    assert mpc._cost.prices[0, 0] == 3.0
    mpc.retune(replace(MPC, backend="daqp"))
    assert mpc._backend.name == "daqp"


def test_matrices_are_needed():
    mpc = SixAxis(MACHINE, MPC, PERIOD)
    solver = make_solver("hpipm", mpc._grid, mpc._cost)
    assert solver.name == "hpipm"
    with pytest.raises(ValueError, match="every solve"):
        solver.solve(None)
