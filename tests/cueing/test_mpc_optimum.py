"""Every period's plan is the optimum of that very period's programme, whatever came before."""

from dataclasses import replace

import numpy as np
import pytest

from motionserver.cueing.registry import make_cueing
from motionserver.cueing.tuning import Tuning
from motionserver.evaluate.bench.plan_steps import LIVELY, time_plans
from motionserver.settings.machine import load_machine
from motionserver.solvers.registry import REFERENCE, make_backend

MACHINE = load_machine("t2-compact")


class Tapped:
    """A solver at the wheel, with an exact and forgetful one asked the same."""

    def __init__(self, driving):
        self.driving, self.name, self.errors = driving, driving.name, []

    def solve(self, vectors, matrices):
        result = self.driving.solve(vectors, matrices)
        best = make_backend(REFERENCE).solve(vectors, matrices)
        self.errors.append((np.abs(result.x - best.x).max(), np.abs(best.x).max()))
        return result


@pytest.mark.parametrize(("backend", "share"), [("daqp", 1e-4), ("piqp", 1e-3)])
def test_the_programme_solved_is_the_one_just_filled(backend, share):
    tuning = replace(Tuning(algorithm="mpc", scale=1.0), backend=backend)
    taps = []

    def make(machine, tuning, period):
        mpc = make_cueing(machine, tuning, period)
        taps.append(Tapped(mpc._backend))
        mpc._backend = taps[0]
        return mpc

    time_plans(MACHINE, tuning, 70, paced=False, make=make, begin=LIVELY + 80)
    errors = np.array(taps[0].errors)
    assert len(errors) == 70
    # something happens: else stale matrices would do as well
    assert errors[:, 1].max() > 0.05
    assert errors[:, 0].max() < share
