"""Who lives and does nothing: looks at a sign of life on virtual time."""

import subprocess
import sys
from itertools import accumulate

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rig import until

from motionserver.supervisor.standstill import (
    LOADING,
    PATIENCE,
    POLL,
    REMIND,
    Activity,
    Standstill,
    activity_of,
)


def looks(watched, begin, count, sign, pid=7, share=None):
    """Look that often; ``share`` of the processor's time is got, None = it does not want any."""
    return [
        watched.look(
            begin + POLL * n, pid, sign, Activity((share or 0.0) * POLL * n, share is not None)
        )
        for n in range(count)
    ]


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


def test_process_that_gets_no_processor_time_is_waited_for():
    watched, now = working()
    # a page at low priority beside others that take nearly all
    assert not any(looks(watched, now, 400, 3, share=0.04))
    # one that turns in a circle uses what it gets
    assert any(looks(watched, now + POLL * 400, 40, 3, share=1.0))


def test_process_loading_on_a_slow_computer_is_given_processor_time():
    watched = Standstill()
    assert not any(looks(watched, 0.0, 1000, 0, share=0.1))
    assert looks(watched, POLL * 1000, 1000, 0, share=0.5).index(True) * 0.5 * POLL <= LOADING


def test_process_ended_while_loading_leaves_more_time_to_the_next():
    watched, now = Standstill(), 0.0
    for pid in (1, 2, 3):
        watched.look(began := now, pid, 0)
        while not watched.look(now := now + POLL, pid, 0):
            pass
        assert now - began == pytest.approx(LOADING * 2.0 ** (pid - 1))
        watched.look(now := now + POLL, None, 0)
    # once one has shown itself, the next is judged like the first
    watched.look(now, 4, 0)
    watched.look(now + POLL, 4, 1)
    assert looks(watched, now + 2 * POLL, 200, 1, pid=5).index(True) * POLL == pytest.approx(
        LOADING
    )


def test_loading_is_told_now_and_then_until_it_ends():
    watched, told = Standstill(), []
    for n in range(int(LOADING / POLL)):
        watched.look(n * POLL, 7, 0, Activity(0.1 * n * POLL, True))
        told += filter(None, [watched.still_loading()])
    assert len(told) == int(LOADING / REMIND) - 1
    assert "30 s after its start and with 3.0 s of processor time" in told[1]
    watched.look(LOADING, 7, 1, Activity(9.0, True))
    assert not any((looks(watched, LOADING + POLL, 60, 1), watched.still_loading())[1])


def test_activity_is_what_the_kernel_says():
    spin = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    rest = subprocess.Popen(["sleep", "60"])
    try:
        until(lambda: activity_of(spin.pid).processor_s > 0.05, "processor time")
        assert activity_of(spin.pid).is_held_up
        until(lambda: not activity_of(rest.pid).is_held_up, "sleep")
    finally:
        for process in (spin, rest):
            process.kill()
            process.wait()
    assert activity_of(rest.pid) == Activity()
