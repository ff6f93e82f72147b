"""All recordings, long: never beyond a limit, and better than the rivals where we say so."""

from functools import cache

import pytest
from own_hexapod import NO_VIOLATIONS, RECORDINGS, own_violations

from motionserver.cueing.tuning import Tuning
from motionserver.evaluate.drive import no_motion
from motionserver.evaluate.lockstep import drive
from motionserver.evaluate.metrics.figures import figures_of, rmse_xy
from motionserver.evaluate.recording import read_recording
from motionserver.evaluate.yardstick import find_yardstick
from motionserver.settings.machine import load_machine

pytestmark = [pytest.mark.campaign, pytest.mark.timeout(3600)]

MACHINE = load_machine("t2-compact")
NAMES = sorted(path.stem for path in RECORDINGS.glob("*.csv"))


@cache
def recorded(name):
    return read_recording(RECORDINGS / f"{name}.csv")


@pytest.mark.parametrize("algorithm", ["thondel2014", "classical"])
@pytest.mark.parametrize("scale", [0.6, 1.0])
@pytest.mark.parametrize("name", NAMES)
def test_no_executed_sample_is_beyond_a_limit(name, scale, algorithm):
    driven = drive(MACHINE, recorded(name), Tuning(algorithm=algorithm, scale=scale))
    assert own_violations(driven.pose, driven.rate) == NO_VIOLATIONS
    assert figures_of(driven).workspace.violations == 0
    assert driven.periods.rejections == {}
    assert driven.periods.troubles == {}


@pytest.mark.parametrize("name", ["truck_brake_accel", "truck_roundabout"])
def test_thondel2014_is_below_yardstick_and_no_motion(name):
    recording, tuning = recorded(name), Tuning(algorithm="thondel2014", scale=0.6)
    ours = rmse_xy(drive(MACHINE, recording, tuning))
    yardstick = find_yardstick(MACHINE, recording, tuning, jobs=2)
    still = rmse_xy(no_motion(MACHINE, recording, 0.6))
    assert ours < min(dict(yardstick.tried)[yardstick.gain], still)
