"""The most eventful stretch: found, inside, the same every time."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motionserver.errors import ConfigError
from motionserver.evaluate.recording import from_samples
from motionserver.evaluate.tune.stretches import LEAD, most_eventful, stretches_of


def drive(burst=None, seconds=60.0, name="drive"):
    times = np.arange(0.0, seconds + 1e-9, 0.01)
    force = np.zeros((len(times), 3))
    force[:, 0] = 3.0  # a long slope is no event
    if burst is not None:
        inside = (times >= burst) & (times < burst + 4.0)
        force[inside, 1] = 2.0 * np.sin(2.0 * np.pi * (times[inside] - burst))
    return from_samples(name, times, force, np.zeros_like(force), np.zeros(len(times)))


@given(burst=st.floats(0.0, 56.0))
def test_finds_the_manoeuvre_and_stays_inside(burst):
    found = most_eventful(drive(burst), 5.0)
    assert found.start >= 0.0
    assert found.end <= 60.0 + 1e-9
    assert found.start <= burst + 0.3
    assert found.end >= burst + 3.7
    assert found.lead == min(LEAD, found.start)
    assert found.recording.duration == pytest.approx(5.0 + found.lead, abs=0.011)


def test_nothing_happens_then_the_beginning():
    assert most_eventful(drive(), 5.0).start == 0.0


@pytest.mark.parametrize("seconds", [0.0, 60.0, 100.0])
def test_whole_drive(seconds):
    found = most_eventful(drive(10.0), seconds)
    assert (found.start, found.end, found.lead) == (0.0, 60.0, 0.0)
    assert len(found.recording.times) == 6001


def test_digest_tells_drives_apart_but_not_names():
    one = most_eventful(drive(10.0), 5.0)
    assert one.digest == most_eventful(drive(10.0), 5.0).digest
    assert one.digest == replace(one, recording=replace(one.recording, name="x")).digest
    assert one.digest != most_eventful(drive(10.5), 5.5).digest
    assert one.digest != replace(one, lead=1.0).digest
    other = replace(one.recording, speed=one.recording.speed + 1e-9)
    assert one.digest != replace(one, recording=other).digest


def test_refuses_what_cannot_be_held_out():
    with pytest.raises(ConfigError, match="1 given; to hold one out, two are needed"):
        stretches_of([drive(1.0)], 5.0)
    with pytest.raises(ConfigError, match="drive given more than once"):
        stretches_of([drive(1.0), drive(2.0)], 5.0)
    names = [s.name for s in stretches_of([drive(1.0, name="b"), drive(2.0, name="a")], 5.0)]
    assert names == ["b", "a"]
