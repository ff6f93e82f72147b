from dataclasses import replace

import numpy as np
import pytest
from cueing.cueing_loop import play, stimulus_of

from motionserver.core.axes import GRAVITY, Axis
from motionserver.core.plan import rest_at
from motionserver.core.state import PlatformState, Preview
from motionserver.cueing.thondel import Thondel
from motionserver.cueing.tuning import Tuning

REST = rest_at(np.zeros(6))
START = PlatformState.at_rest(np.zeros(6))
STEADY = Tuning(reference="constant")


def test_preview_tilts_before_the_brake(machine):
    times = np.array([0.0, 0.99, 1.0, 2.0])
    force = np.array([[0.0] * 3, [0.0] * 3, [-3.0, 0, 0], [-3.0, 0, 0]])
    known = Preview(times, force, np.zeros((4, 3)))
    ends = [
        Thondel(machine, STEADY, 0.01)
        .propose(START, REST, 0.01, stimulus_of((0, 0, 0), preview=preview))
        .pose
        for preview in (None, known)
    ]
    assert np.abs(ends[0]).max() < 1e-9
    assert ends[1][:, Axis.PITCH].max() > 0.01


def test_leg_rows_make_the_governor_rare(machine):
    stimuli = [stimulus_of((-8, 5, 3))] * 80
    shares = []
    for legs in (False, True):
        tuning = replace(STEADY, legs=legs, halving="off")
        shares.append(np.mean(play(machine, Thondel(machine, tuning, 0.01), stimuli).kappas))
    assert shares[1] > shares[0] + 0.2
    # from rest the nearer end of the stroke is a guess; after that it is known
    assert shares[1] > 0.9


def test_box_is_kept_without_leg_rows(machine):
    tuning = replace(STEADY, legs=False, box=0.3 * machine.box, halving="off")
    candidate = Thondel(machine, tuning, 0.01).propose(START, REST, 0.01, stimulus_of((-8, 5, 6)))
    assert (np.abs(candidate.pose) < 0.3 * machine.box * 1.06).all()


def test_tilt_rate_is_kept(machine):
    candidate = Thondel(machine, STEADY, 0.01).propose(START, REST, 0.01, stimulus_of((-3, 3, 0)))
    assert np.abs(candidate.velocity[:12, 3:5]).max() < 1.1 * STEADY.tilt_rate


def test_tilt_acceleration_row(machine):
    peaks = []
    for weight in (0.0, 20.0):
        tuning = replace(STEADY, tilt_acceleration=0.2, tilt_acceleration_weight=weight)
        plan = Thondel(machine, tuning, 0.01).propose(START, REST, 0.01, stimulus_of((-3, 0, 0)))
        peaks.append(np.abs(plan.acceleration[:-1, Axis.PITCH]).max())
    assert peaks[1] < 0.8 * peaks[0]


def test_vehicle_rotation_shares_the_box(machine):
    """A platform turned by the vehicle's own pitch leaves less for tilt."""
    tuning = replace(STEADY, legs=False, halving="off", box=0.2 * machine.box)
    stimuli = [stimulus_of((-3, 0, 0), (0, 0.2, 0))] * 150
    pose = np.concatenate(play(machine, Thondel(machine, tuning, 0.01), stimuli).pose)
    # the rotation itself is not bound; the tilt gives way to it
    assert pose[-1, Axis.PITCH] < 0.25 + 0.2 * machine.box[Axis.PITCH]


@pytest.mark.parametrize(("axis", "sign"), [(0, 1.0), (1, 1.0), (2, 1.0)])
def test_disturbance_is_counteracted(machine, axis, sign):
    cueing = Thondel(machine, STEADY, 0.01)
    cueing.disturbance = np.eye(3)[axis] * 0.2
    candidate = cueing.propose(START, REST, 0.01, stimulus_of((0, 0, 0)))
    assert sign * candidate.pose[-1, axis] < -1e-4


def test_disturbance_is_bounded_and_may_be_nonsense(machine):
    poses = []
    for value in (0.3, 9.0, np.nan):
        cueing = Thondel(machine, STEADY, 0.01)
        cueing.disturbance = np.array([value, 0.0, 0.0])
        poses.append(cueing.propose(START, REST, 0.01, stimulus_of((0, 0, 0))).pose)
    assert poses[0] == pytest.approx(poses[1])
    assert np.abs(poses[2]).max() < 1e-9


def test_known_offset_of_vehicle_rotation(machine):
    """A pitched vehicle whose rates turned the platform needs no tilt for its own gravity."""
    cueing = Thondel(machine, STEADY, 0.01)
    wanted = np.zeros((3, 6))
    turn = np.zeros((3, 6))
    turn[:, Axis.PITCH] = 0.1
    aim = cueing._aim(wanted, turn, np.zeros((3, 6)))
    assert aim[0] == pytest.approx(np.full(3, 0.1 * GRAVITY))
    assert not aim[1:].any()


def test_head_above_the_reference_point_sees_tilt_acceleration(machine):
    high = machine.with_head(np.array([0.0, 0.0, 1.2]))
    low_row = Thondel(machine, STEADY, 0.01)._plant.out_gamma
    high_row = Thondel(high, STEADY, 0.01)._plant.out_gamma
    assert high_row[0] != pytest.approx(low_row[0])
    assert high_row[2] == pytest.approx(low_row[2])


def test_report_predicts_and_names_the_limits(machine):
    cueing = Thondel(machine, STEADY, 0.01)
    cueing.propose(START, REST, 0.01, stimulus_of((1, 0, 0)))
    report = cueing.report()
    assert report.solver_status == "solved"
    assert report.x_max == pytest.approx(machine.box)
    assert {"predicted_x", "leg_slack", "tilt_rate_slack"} <= set(report.numbers)


def test_unknown_words_are_refused(machine):
    for word in ("filters", "reference", "halving", "backend"):
        with pytest.raises(ValueError, match="nonsense"):
            Thondel(machine, replace(STEADY, **{word: "nonsense"}), 0.01)


def test_a_refused_retune_changes_nothing(machine):
    cueing = Thondel(machine, STEADY, 0.01)
    before = cueing.propose(START, REST, 0.01, stimulus_of((1, 0, 0))).pose
    for word in ("filters", "reference", "halving", "backend"):
        with pytest.raises(ValueError, match="nonsense"):
            cueing.retune(replace(STEADY, horizon=1.0, **{word: "nonsense"}))
    fresh = Thondel(machine, STEADY, 0.01)
    fresh.propose(START, REST, 0.01, stimulus_of((1, 0, 0)))
    after = cueing.propose(START, REST, 0.01, stimulus_of((1, 0, 0))).pose
    assert after == pytest.approx(before, abs=1e-9)
