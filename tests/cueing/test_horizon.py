import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motionserver.cueing.filters import FILTER_SETS, channel, discretise
from motionserver.cueing.horizon import condense, make_grid

FIG3 = FILTER_SETS["fig3"]
BLOCK = channel(FIG3.high, FIG3.low)


@settings(max_examples=40, deadline=None)
@given(st.floats(0.3, 3.5), st.sampled_from([0.005, 0.008, 1 / 60, 0.01, 0.02]))
def test_grid(horizon, period):
    grid = make_grid(horizon, period)
    lengths = np.diff(grid.edges)
    assert lengths[:2] == pytest.approx([period, period], rel=0.5)
    assert lengths[0] == pytest.approx(period)
    assert (lengths[1:] / lengths[:-1] < 1.5 + 1e-6).all()
    assert grid.edges[-1] == pytest.approx(horizon)
    assert grid.knots[-1] == pytest.approx(horizon)
    assert (np.diff(grid.knots) > 1e-4).all()
    assert len(grid.knots) <= 200
    assert grid.node_share.sum() == pytest.approx(horizon)
    assert set(grid.node_piece) == set(range(len(lengths)))
    ends = grid.knots[grid.nodes]
    assert (ends > grid.edges[grid.node_piece] - 1e-9).all()
    assert (ends < grid.edges[grid.node_piece + 1] + 1e-9).all()


def test_condensed_equals_step_by_step():
    grid = make_grid(2.0, 0.01)
    maps = condense(BLOCK, grid)
    rng = np.random.default_rng(1)
    start, u = rng.normal(size=6) * 0.1, rng.normal(size=len(grid.edges) - 1)
    state, begin = start, 0.0
    for index, knot in enumerate(grid.knots):
        piece = np.searchsorted(grid.edges, 0.5 * (begin + knot)) - 1
        a, b = discretise(BLOCK, knot - begin)
        state = a @ state + b * u[piece]
        begin = knot
        assert maps.phi[index] @ start + maps.gamma[index] @ u == pytest.approx(state, abs=1e-9)
