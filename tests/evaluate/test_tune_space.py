"""What is searched: within the bounds, evenly, and the same for the same seed."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motionserver.errors import ConfigError
from motionserver.evaluate.tune.result import model_of
from motionserver.evaluate.tune.space import NEAR, SPACES, near, pool, space_of
from motionserver.settings.tuning import TuningModel

SEARCHED = pytest.mark.parametrize("algorithm", SPACES)


@SEARCHED
@given(seed=st.integers(0, 2**31 - 1), count=st.integers(0, 40))
def test_every_point_may_be_set_on_the_page(algorithm, seed, count):
    space = space_of(algorithm, search_scale=True)
    points = pool(space, count, seed)
    assert len(points) == count
    for point in points:
        assert list(point) == [p.name for p in space]
        model_of(TuningModel(), point)
        for p in space:
            assert p.choices or p.low <= point[p.name] <= p.high


@SEARCHED
def test_more_trials_continue_fewer(algorithm):
    space = space_of(algorithm)
    many = pool(space, 33, 7)
    assert [pool(space, count, 7) for count in (1, 5, 16)] == [many[:1], many[:5], many[:16]]
    assert pool(space, 5, 8) != many[:5]


@SEARCHED
def test_defaults_lie_inside_and_shares_come_back(algorithm):
    for p in space_of(algorithm, search_scale=True):
        default = TuningModel.model_fields[p.name].default
        assert 0.0 <= p.share(default) <= 1.0
        assert not p.at_bound(default)
        for share in (0.01, 0.3, 0.99):
            assert p.at(share) == p.at(p.share(p.at(share)))
        assert p.choices or (p.at_bound(p.low) and p.at_bound(p.high))


def test_pool_is_even():
    """Of 32 points each half of each range holds half."""
    space = space_of("thondel2014")
    points = pool(space, 32, 3)
    shares = np.array([[p.share(point[p.name]) for p in space] for point in points])
    assert (shares < 0.5).sum(axis=0).tolist() == [16, 16, 16]


@SEARCHED
@given(seed=st.integers(0, 1000), corner=st.floats(0.0, 1.0))
def test_neighbours_are_near_and_the_same_for_all_who_ask(algorithm, seed, corner):
    space = space_of(algorithm)
    centre = {p.name: p.at(corner) for p in space}
    points = near(space, centre, 5, seed)
    assert points == near(space, dict(centre), 5, seed)
    for point in points:
        for p in space:
            if p.choices:
                assert point[p.name] == centre[p.name]
            else:
                assert abs(p.share(point[p.name]) - p.share(centre[p.name])) <= NEAR + 1e-3


def test_held_out_drives_do_not_come_in_by_a_fitted_predictor():
    reference = next(p for p in space_of("mpc") if p.name == "reference")
    assert "learned" not in reference.choices


def test_unknown_algorithm_is_refused():
    with pytest.raises(ConfigError, match=r"nothing is known to tune of 'other'.*classical"):
        space_of("other")
