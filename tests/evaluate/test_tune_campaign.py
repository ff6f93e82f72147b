"""A real search, long: all shipped drives, leave-one-out, no limit ever broken."""

import pytest
from own_hexapod import RECORDINGS

from motionserver.evaluate.tune.command import tune

pytestmark = [pytest.mark.campaign, pytest.mark.timeout(7200)]


@pytest.mark.parametrize("algorithm", ["mpc", "thondel2014", "classical"])
def test_no_trial_breaks_a_limit_on_any_drive(algorithm, tmp_path):
    found = tune(sorted(RECORDINGS.glob("*.csv")), out=tmp_path, algorithm=algorithm, jobs=2)
    for trial in found.trials:
        for name, outcome in trial.outcomes.items():
            assert (name, outcome.violations, outcome.rejected) == (name, 0, 0)
    assert found.held_out_violations == 0
    print(algorithm, found.held_out_score, found.score(found.default))
