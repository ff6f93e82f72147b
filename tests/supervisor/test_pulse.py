"""Frozen or merely unlucky: looks at the guard's clock on virtual time."""

import os
import signal
import subprocess
import sys
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motionserver.supervisor.pulse import FROZEN, POLL, STARVED, Pulse, is_runnable


def looks(pulse, times, written, pid=7):
    return [pulse.look(now, pid, written) for now in times]


def every(step, count, begin=100.0):
    return [begin + step * number for number in range(count)]


def test_a_clock_that_stands_is_found_after_that_time_and_once():
    found = looks(Pulse(), every(POLL, 40), 5)
    first = found.index(True)
    assert FROZEN <= first * POLL <= FROZEN + 2 * POLL
    # judged anew: a kill needs a moment
    assert found.index(True, first + 1) - first == pytest.approx(FROZEN / POLL, abs=1)


@given(st.lists(st.floats(0.0, 2.0), min_size=1, max_size=200))
def test_a_clock_that_advances_is_alive_whatever_the_looks(gaps):
    pulse, now = Pulse(), 0.0
    for number, gap in enumerate(gaps, 1):
        now += gap
        assert not pulse.look(now, 7, number)


@given(st.lists(st.floats(2.6 * POLL, 2.0), max_size=100))
def test_late_looks_prove_nothing(gaps):
    pulse, now = Pulse(), 0.0
    for gap in gaps:
        now += gap
        assert not pulse.look(now, 7, 5)


def test_a_guard_that_has_not_written_or_is_gone_is_not_judged():
    assert not any(looks(Pulse(), every(POLL, 100), 0))
    assert not any(looks(Pulse(), every(POLL, 100), 5, None))


def test_another_guard_begins_anew():
    pulse = Pulse()
    few = int(FROZEN / POLL) - 1
    assert not any(looks(pulse, every(POLL, few), 5))
    assert not any(looks(pulse, every(POLL, few, 100.0 + few * POLL), 5, 8))


def test_one_that_waits_for_the_processor_is_given_more_time():
    pulse = Pulse()
    found = [pulse.look(now, 7, 5, runnable=True) for now in every(POLL, 60)]
    assert STARVED <= found.index(True) * POLL <= STARVED + 2 * POLL


def test_the_kernel_tells_running_sleeping_and_stopped_apart():
    assert is_runnable(os.getpid())
    asleep = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    try:
        for number in (signal.SIGCONT, signal.SIGSTOP):
            asleep.send_signal(number)
            # it wakes for the signal: runnable for a moment
            while is_runnable(asleep.pid):
                time.sleep(0.01)
    finally:
        asleep.kill()
        asleep.wait()
    assert not is_runnable(asleep.pid)
