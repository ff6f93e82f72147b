import numpy as np
import pytest

from motionserver.core.kinematics.hexapod import leg_lengths
from motionserver.core.state import PlatformState
from motionserver.cueing.halving import STOP_RATE, make_halving, stopping_reach

STILL = PlatformState.at_rest(np.zeros(6))
INSIDE = np.zeros((2, 6))
OUTSIDE = np.array([[0.0] * 6, [0.25, 0.0, 0.0, 0.0, 0.0, 0.0]])


def test_outside_fixture_is_outside(machine):
    legs = leg_lengths(machine, OUTSIDE)
    assert legs[1].max() > machine.leg_max or legs[1].min() < machine.leg_min


def test_paper_halves_towards_the_predicted_position(machine):
    halving = make_halving("paper", machine, machine.box, 0.01)
    halving.x_max = np.array([0.3, 0.22, 0.2, 0.3, 0.28, 0.3])
    pose = OUTSIDE.copy()
    pose[-1, 0] = -0.25
    halving.settle(pose, STILL, np.full(6, 0.4), False)
    # surge, the affected direction: (0.3 + |-0.25|)/2; the others open: (X + 0.4)/2
    assert halving.x_max == pytest.approx([0.275, 0.31, 0.3, 0.35, 0.34, 0.35])


def test_paper_opens_half_way(machine):
    halving = make_halving("paper", machine, machine.box, 0.01)
    halving.x_max = 0.5 * machine.box
    halving.settle(INSIDE, STILL, machine.box, False)
    assert halving.x_max == pytest.approx(0.75 * machine.box)


def test_paper_never_below_the_stopping_distance(machine):
    halving = make_halving("paper", machine, machine.box, 0.01)
    halving.x_max = np.full(6, 0.3)
    velocity = np.array([0.6, 0, 0, 0, 0, 0])
    start = PlatformState(np.array([0.18, 0, 0, 0, 0, 0.0]), velocity, np.zeros(6))
    pose = OUTSIDE.copy()
    halving.settle(pose, start, np.full(6, 0.5), False)
    assert halving.x_max[0] == pytest.approx(0.18 + 0.36 / (2 * STOP_RATE[0]))
    assert stopping_reach(start)[0] == pytest.approx(0.3)


def test_sound_shrinks_without_jumps_and_opens_again(machine):
    halving = make_halving("sound", machine, machine.box, 0.01)
    sizes = [halving.x_max.copy()]
    for _ in range(100):
        halving.settle(OUTSIDE, STILL, machine.box, False)
        sizes.append(halving.x_max.copy())
    for _ in range(1000):
        halving.settle(INSIDE, STILL, machine.box, False)
        sizes.append(halving.x_max.copy())
    table = np.array(sizes)
    assert table[100, 0] < 0.9 * machine.box[0]
    # only the axis that drives the leg out closes
    assert table[100, 1] == pytest.approx(machine.box[1])
    assert np.abs(np.diff(table, axis=0)).max() < 0.05 * machine.box.max()
    assert table[-1] == pytest.approx(machine.box, rel=0.01)
    assert (table <= machine.box + 1e-12).all()


def test_sound_closes_when_the_governor_cut(machine):
    halving = make_halving("sound", machine, machine.box, 0.01)
    near = 0.9 * OUTSIDE * 0.19 / 0.25
    halving.settle(near, STILL, machine.box, True)
    assert halving.x_max[0] < machine.box[0]


def test_off_follows_the_tunable_box(machine):
    halving = make_halving("off", machine, machine.box, 0.01)
    halving.settle(OUTSIDE, STILL, 0.5 * machine.box, True)
    assert halving.x_max == pytest.approx(0.5 * machine.box)


def test_unknown(machine):
    with pytest.raises(ValueError, match="off, paper, sound"):
        make_halving("third", machine, machine.box, 0.01)
