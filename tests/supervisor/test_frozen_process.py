"""Who lives and does nothing: looks at a sign of life on virtual time."""

from itertools import accumulate

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motionserver.supervisor.standstill import LOADING, PATIENCE, POLL, Standstill


def looks(watched, begin, count, sign, pid=7):
    return [watched.look(begin + POLL * n, pid, sign) for n in range(count)]


def working():
    """One that has shown itself twice, and how late it is now [s]."""
    watched = Standstill()
    for n in range(4):
        assert not watched.look(100.0 + POLL * n, 7, n)
    return watched, 100.0 + POLL * 4


def test_a_sign_that_stays_the_same_is_found_after_that_time_and_once():
    watched, now = working()
    found = looks(watched, now, 60, 3)
    first = found.index(True)
    assert (first + 1) * POLL == pytest.approx(PATIENCE)
    # judged anew: a kill needs a moment
    assert found.index(True, first + 1) - first == pytest.approx(PATIENCE / POLL)


def test_one_that_was_just_started_may_load():
    watched, now = working()
    found = looks(watched, now, 200, 3, pid=8)
    assert found.index(True) * POLL == pytest.approx(LOADING)
    # it has shown itself: from now on the shorter patience counts
    now += POLL * 200
    assert not watched.look(now, 8, 4)
    assert looks(watched, now + POLL, 60, 4, pid=8).index(True) * POLL < PATIENCE


def test_nobody_cannot_stand_still():
    watched, now = working()
    assert not any(looks(watched, now, 500, 3, pid=None))


@given(st.lists(st.floats(0.0, 100.0), min_size=1, max_size=100))
def test_one_that_counts_is_alive_whatever_the_looks(gaps):
    watched = Standstill()
    for number, now in enumerate(accumulate(gaps), 1):
        assert not watched.look(now, 7, number)


@given(st.lists(st.floats(3.01 * POLL, 1000.0), max_size=100))
def test_looks_that_come_late_say_nothing(gaps):
    watched, _ = working()
    for now in accumulate(gaps, initial=200.0):
        assert not watched.look(now, 7, 3)
