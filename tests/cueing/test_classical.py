import numpy as np
import pytest
from cueing.cueing_loop import play, stimulus_of
from hypothesis import given, settings
from hypothesis import strategies as st

from motionserver.core.axes import Axis
from motionserver.cueing.classical import REID_NAHON, Classical, TiltLoop
from motionserver.cueing.filters import channel, check_controllable, discretise, low_pass
from motionserver.cueing.tuning import Tuning

STEPS = np.full(200, 0.01)
RATE = np.radians(3.0)


def test_unlimited_loop_is_the_low_pass():
    loop = TiltLoop(REID_NAHON.low, STEPS)
    wanted = np.full((200, 1), 0.001)
    found = loop.run(np.zeros((3, 1)), wanted, 1e9)
    _, b = discretise(low_pass(REID_NAHON.low), 2.0)
    assert found[:, -1, 0] == pytest.approx(b * 0.001 * 9.81, abs=1e-9)


@settings(max_examples=8, deadline=None)
@given(st.floats(-0.5, 0.5))
def test_limited_loop_keeps_the_rate_and_arrives(goal):
    loop = TiltLoop(REID_NAHON.low, np.full(700, 0.02))
    found = loop.run(np.zeros((3, 1)), np.full((700, 1), goal), RATE)
    assert np.abs(found[1]).max() <= RATE * 1.001
    assert found[0, -1, 0] == pytest.approx(goal, abs=1e-3)


def test_limit_binds_in_a_hard_stop(machine):
    cueing = Classical(machine, Tuning(gain=1.0), 0.01)
    played = play(machine, cueing, [stimulus_of((-2.5, 0, 0))] * 150)
    rate = np.concatenate(played.velocity)[:, Axis.PITCH]
    assert rate.max() == pytest.approx(RATE, rel=0.02)


def test_gain_scales(machine):
    stimuli = [stimulus_of((0.1, 0, 0))] * 30
    ends = [
        play(machine, Classical(machine, Tuning(gain=gain), 0.01), stimuli).pose[-1][-1]
        for gain in (0.5, 1.0)
    ]
    assert ends[1] == pytest.approx(2.0 * ends[0], abs=1e-6)


def test_its_corners_are_controllable():
    check_controllable(channel(REID_NAHON.high, REID_NAHON.low), "reid-nahon")
