"""The emulator's kinematics and the server's, written apart, must have read the same table."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from motion_clients.hexapod_legs import T2_COMPACT
from motion_clients.moog_config import MoogConfig

from motionserver.core.kinematics.hexapod import leg_lengths
from motionserver.settings.machine import load_machine

MACHINE = load_machine("t2-compact")


@given(pose=st.tuples(*[st.floats(-0.4, 0.4)] * 6))
@settings(max_examples=200)
def test_both_find_the_same_legs(pose):
    theirs = np.asarray(leg_lengths(MACHINE, np.array(pose))).reshape(6)
    ours = np.array(T2_COMPACT.extensions(pose)) + T2_COMPACT.leg_retracted
    assert np.allclose(theirs, ours, rtol=0.0, atol=1e-9)


def test_both_park_at_the_same_pose():
    home = np.array(MoogConfig().home) + T2_COMPACT.leg_retracted
    parked = np.array([0.0, 0.0, MoogConfig().home_heave, 0.0, 0.0, 0.0])
    assert np.allclose(np.asarray(leg_lengths(MACHINE, parked)).reshape(6), home, atol=1e-9)
