"""Every tunable an algorithm declares changes its plans; every other one leaves them to the bit.

Numbers go to both ends of what the page allows, words through all choices.
"""

from dataclasses import replace

import numpy as np
import pytest
from machines import compact

from motionserver.core.axes import frozen
from motionserver.core.plan import rest_at
from motionserver.core.state import Stimulus
from motionserver.cueing.registry import make_cueing, tunables_of
from motionserver.cueing.tuning import COMMON, TUNABLES, Tuning
from motionserver.settings.tuning import apply_changes, default_for, describe
from motionserver.settings.tuning_fields import SI_NAMES

MACHINE = compact()
PERIOD = 1 / 32
PERIODS = 24
NEEDS = {"tilt_acceleration": {"tilt_acceleration_weight": 5.0}}
"""What else must be set for a tunable to act: this threshold counts only at a price."""


def drive():
    """A launch, a hard brake in a curve, and bumps: enough to reach limits of tilt and legs."""
    for k in range(PERIODS):
        t = k * PERIOD
        force = [6.0 * np.sin(5.0 * t) + 3.0, 5.0 * np.cos(3.0 * t), 2.5 * np.sin(25.0 * t)]
        rates = [0.4 * np.sin(6.0 * t), 0.3 * np.cos(5.0 * t), 0.5 * np.sin(2.0 * t)]
        yield Stimulus(frozen(force), frozen(rates))


def plans(tuning):
    """All plans of one drive, each on top of the one before, as one array."""
    cueing, plan = make_cueing(MACHINE, tuning, PERIOD), rest_at(np.zeros(6), 1)
    out = []
    for number, stimulus in enumerate(drive(), 2):
        candidate = cueing.propose(plan.state(PERIOD), plan, PERIOD, stimulus)
        assert candidate is not None
        parts = candidate.pose, candidate.velocity, candidate.acceleration
        plan = type(plan)(number, plan.plan_id, PERIOD, candidate.times, *parts)
        cueing.adopt(plan, 1.0)
        out += [candidate.times, *(part.ravel() for part in parts)]
    return np.concatenate(out)


def values_of(name):
    """Tunings that differ in this tunable alone, in every way the page allows."""
    base = replace(default_for(MACHINE).to_tuning(), **NEEDS.get(name, {}))
    for field in describe(MACHINE):
        if SI_NAMES.get(field["name"], field["name"]) != name:
            continue
        for value in field.get("choices", ()) or (field["min"], field["max"]):
            if (name, value) in (("backend", "hpipm"), ("reference", "learned")):
                continue  # not installed with the tests; needs a file
            model = apply_changes(default_for(MACHINE), {field["name"]: value})
            yield replace(base, **{name: getattr(model.to_tuning(), name)})


@pytest.fixture(scope="module")
def of_default():
    known = {}

    def found(algorithm, name):
        key = (algorithm, name if name in NEEDS else "")
        if key not in known:
            changes = NEEDS.get(name, {})
            base = replace(default_for(MACHINE).to_tuning(), algorithm=algorithm)
            known[key] = plans(replace(base, **changes))
        return known[key]

    return found


CASES = [
    (algorithm, name)
    for algorithm in ("mpc", "thondel2014", "classical")
    # a predictor is the path of a file, which tests of the reference models write
    for name in sorted(TUNABLES - COMMON - {"predictor"})
]


@pytest.mark.parametrize(("algorithm", "name"), CASES)
def test_tunable_changes_the_plans_if_and_only_if_it_is_declared(of_default, algorithm, name):
    usual = of_default(algorithm, name)
    is_declared = name in tunables_of(algorithm)
    changed = False
    for tuning in values_of(name):
        got = plans(replace(tuning, algorithm=algorithm))
        changed = got.shape != usual.shape or not np.array_equal(got, usual)
        if changed:
            break
    assert changed == is_declared


def test_every_tunable_is_read_by_some_algorithm():
    read = set().union(*(tunables_of(one) for one in ("mpc", "thondel2014", "classical")))
    assert read == TUNABLES == set(Tuning.__slots__) - {"options"}
