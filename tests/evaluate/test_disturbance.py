"""Planners troubled on purpose: the accepted plan plays on, no limit breaks."""

import numpy as np
import pytest
from own_hexapod import NO_VIOLATIONS, RECORDINGS, own_violations

from motionserver.cueing.think import Thinker
from motionserver.cueing.tuning import Tuning
from motionserver.evaluate.disturbance import FAILED, STALLED, Disturbance
from motionserver.evaluate.lockstep import drive
from motionserver.evaluate.recording import read_recording
from motionserver.settings.machine import load_machine

MACHINE = load_machine("t2-compact")
BRAKE = read_recording(RECORDINGS / "truck_brake_accel.csv").excerpt(40.0, 44.0)
CLASSICAL = Tuning(algorithm="classical")


def periods_of(disturbance):
    return drive(MACHINE, BRAKE, CLASSICAL, disturbance=disturbance).periods


def test_stalls_last_and_failures_do_not():
    periods = periods_of(Disturbance(3, stalled=0.05, failed=0.0, nan=0.0))
    without = np.isnan(periods.kappa)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], without.astype(int), [0]))))
    lengths = edges[1::2] - edges[::2]
    assert periods.troubles == {STALLED: int(without.sum())}
    assert without.any()
    # late by 50 ms on a 10 ms period: five periods each, the last may be cut off
    assert set((lengths % 5).tolist()) <= {0} or lengths[-1] % 5 != 0
    failed = periods_of(Disturbance(3, stalled=0.0, failed=0.1, nan=0.0))
    assert failed.troubles == {FAILED: int(np.isnan(failed.kappa).sum())}
    assert 0.05 < np.isnan(failed.kappa).mean() < 0.15


def test_numbers_that_are_none_never_reach_the_platform():
    driven = drive(
        MACHINE, BRAKE, CLASSICAL, disturbance=Disturbance(1, stalled=0.0, failed=0.0, nan=0.3)
    )
    assert np.isfinite(driven.pose).all()
    assert own_violations(driven.pose, driven.rate) == NO_VIOLATIONS
    periods = driven.periods
    assert periods.rejections == {}
    # a pose is seen before the governor, a velocity or acceleration by it: then kappa is 0
    assert periods.troubles["the candidate is not finite"] > 10
    assert periods.refusals["not-finite"] > 10


def test_everything_at_once_breaks_no_limit_and_repeats():
    first, second = (
        drive(MACHINE, BRAKE, Tuning(scale=1.0), disturbance=Disturbance(7)) for _ in range(2)
    )
    assert first.pose.tobytes() == second.pose.tobytes()
    assert own_violations(first.pose, first.rate) == NO_VIOLATIONS
    assert first.periods.rejections == {}
    other = drive(MACHINE, BRAKE, Tuning(scale=1.0), disturbance=Disturbance(8))
    assert first.pose.tobytes() != other.pose.tobytes()


def test_an_algorithm_made_anew_is_troubled_again():
    class Fragile:
        name = "fragile"
        disturbance = np.zeros(3)

        def propose(self, start, parent, takeover, stimulus):
            raise ArithmeticError("once")

    thinker = Thinker(MACHINE, CLASSICAL, 0.01, MACHINE.parked_pose[None])
    thinker.cueing = Fragile()
    everything = Disturbance(0, stalled=0.0, failed=1.0, nan=0.0)
    periods = drive(
        MACHINE, BRAKE.excerpt(0.0, 0.1), CLASSICAL, thinker=thinker, disturbance=everything
    ).periods
    assert periods.troubles == {"ArithmeticError: once": 1, FAILED: 10}


def test_nothing_wanted_is_nothing_done():
    quiet = drive(MACHINE, BRAKE, CLASSICAL, disturbance=Disturbance(0, 0.0, 0.05, 0.0, 0.0))
    plain = drive(MACHINE, BRAKE, CLASSICAL)
    assert quiet.pose.tobytes() == plain.pose.tobytes()


@pytest.mark.parametrize(
    "shares",
    [{"stalled": -0.1}, {"failed": 0.6, "nan": 0.6}, {"stall": 0.0}, {"nan": float("nan")}],
)
def test_senseless_shares_are_refused(shares):
    with pytest.raises(ValueError, match="disturbance"):
        Disturbance(**shares)
