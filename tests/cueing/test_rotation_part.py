from dataclasses import replace

import numpy as np
import pytest

from motionserver.core.plan import Plan, rest_at
from motionserver.cueing.filters import FILTER_SETS
from motionserver.cueing.horizon import make_grid
from motionserver.cueing.rotation import REMEMBERED, RotationPart

GRID = make_grid(1.0, 0.01)
MOVES = len(GRID.edges) - 1
RATES = np.full((MOVES, 3), 0.1)


def step(part, parent, number, kappa=1.0, takeover=0.01):
    times, *tables = part.ahead(parent, takeover, RATES, 0.4)
    plan = Plan(number, parent.plan_id, takeover, times, *tables)
    part.adopt(plan, kappa)
    return plan


def test_unknown_parent_has_no_part():
    part = RotationPart(FILTER_SETS["fig3"], GRID)
    assert not part.at(rest_at(np.ones(6), 77), 0.0).pose.any()


def test_grows_ends_at_rest_and_moves_angles_only():
    part = RotationPart(FILTER_SETS["fig3"], GRID)
    plan = step(part, rest_at(np.zeros(6)), 1)
    assert plan.pose[-1, 3:] == pytest.approx(np.full(3, 0.05), abs=0.05)
    assert plan.pose[-1, 3] > 0.03
    assert not plan.pose[:, :3].any()
    assert not plan.velocity[-1].any()


def test_half_a_candidate_is_half_a_part():
    whole, half = (RotationPart(FILTER_SETS["fig3"], GRID) for _ in range(2))
    rest = rest_at(np.zeros(6))
    a, b = step(whole, rest, 1), step(half, rest, 1, kappa=0.5)
    assert half.at(b, 0.3).pose == pytest.approx(0.5 * whole.at(a, 0.3).pose, abs=1e-9)


def test_refused_candidates_leave_the_old_part():
    part = RotationPart(FILTER_SETS["fig3"], GRID)
    plan = step(part, rest_at(np.zeros(6)), 1)
    expected = part.at(plan, 0.5).pose
    part.ahead(plan, 0.2, -RATES, 0.4)
    rest_of = replace(plan, plan_id=2, parent_id=1, takeover=0.2, times=plan.times)
    part.adopt(rest_of, 0.0)
    assert part.at(rest_of, 0.3).pose == pytest.approx(expected, abs=1e-6)


def test_forgets_old_plans():
    part = RotationPart(FILTER_SETS["fig3"], GRID)
    plan = first = step(part, rest_at(np.zeros(6)), 1)
    for number in range(2, REMEMBERED + 3):
        plan = step(part, plan, number)
    assert not part.at(first, 0.3).pose.any()
    assert part.at(plan, 0.3).pose.any()


def test_rebuilding_keeps_the_memory():
    part = RotationPart(FILTER_SETS["fig3"], GRID)
    plan = step(part, rest_at(np.zeros(6)), 1)
    before = part.at(plan, 0.3).pose
    part.rebuild(FILTER_SETS["standard"], make_grid(2.0, 0.02))
    assert part.at(plan, 0.3).pose == pytest.approx(before)
