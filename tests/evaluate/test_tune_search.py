"""Leave-one-out must be exact: what is held out decides nothing in its own fold."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motionserver.core.axes import frozen
from motionserver.errors import ConfigError
from motionserver.evaluate.recording import from_samples
from motionserver.evaluate.tune import driving
from motionserver.evaluate.tune.cache import ResultCache
from motionserver.evaluate.tune.criterion import Criterion, objection
from motionserver.evaluate.tune.outcome import Outcome
from motionserver.evaluate.tune.result import Settings
from motionserver.evaluate.tune.search import Search
from motionserver.evaluate.tune.space import space_of
from motionserver.evaluate.tune.stretches import stretches_of
from motionserver.settings.machine import load_machine
from motionserver.settings.tuning import apply_changes, default_for

MACHINE = load_machine("t2-compact")
NAMES = ("a", "b", "c")
GOOD = Outcome(0.5, 0.5, 0.4, 0.4, 0.1, 0.2, 0.02, 0.04, 0.5, 0.0, 0, 0, "")


def searched(tmp_path_factory, answer, monkeypatch, trials=9, refine=0, criterion="rmse"):
    """Search with drives replaced by ``answer(recording, tuning)``."""
    times = np.arange(100) * 0.01
    stretches = stretches_of(
        [
            from_samples(n, times, np.full((100, 3), float(i)), np.zeros((100, 3)), times)
            for i, n in enumerate(NAMES)
        ],
        0.0,
    )
    base = apply_changes(default_for(MACHINE), {"algorithm": "thondel2014"})
    asked = Settings(
        "thondel2014", Criterion(criterion), trials, refine, 1, 0.0, 50.0, base,
        space_of("thondel2014"),
    )  # fmt: skip
    monkeypatch.setattr(driving, "run", lambda job: answer(job.stretch.name, job.tuning))
    path = tmp_path_factory.mktemp("tune") / "drives.jsonl"
    with ResultCache(path) as cache:
        return Search(MACHINE, stretches, asked, cache).run("again")


def bowl(shift):
    """An error with its least at another position weight for every recording."""

    def answer(name, tuning):
        wanted = np.log(shift[name])
        return replace(GOOD, nrmse=0.3 + abs(np.log(tuning.weight_position) - wanted) / 10.0)

    return answer


@settings(max_examples=15, deadline=None)
@given(
    held=st.sampled_from(NAMES),
    changed=st.floats(0.3, 28.0),
    refine=st.sampled_from((0, 3)),
)
def test_choice_of_a_fold_does_not_depend_on_what_it_holds_out(
    tmp_path_factory, held, changed, refine
):
    shift = {"a": 0.5, "b": 2.0, "c": 8.0}
    with pytest.MonkeyPatch.context() as patch:
        before = searched(tmp_path_factory, bowl(shift), patch, refine=refine)
        after = searched(tmp_path_factory, bowl(shift | {held: changed}), patch, refine=refine)
    assert before.fold_tunings.keys() == set(NAMES)
    same = {n: _values(before, n) == _values(after, n) for n in NAMES}
    assert same[held]
    fold = next(f for f in before.folds if f.held_out == held)
    assert fold.score == next(f for f in after.folds if f.held_out == held).score


def _values(result, name):
    return next(f.trial.values for f in result.folds if f.held_out == name)


@pytest.mark.parametrize("refine", [0, 4])
def test_final_choice_is_the_least_mean_and_folds_the_least_of_theirs(
    tmp_path_factory, monkeypatch, refine
):
    found = searched(tmp_path_factory, bowl({"a": 0.5, "b": 2.0, "c": 8.0}), monkeypatch,
                     refine=refine)  # fmt: skip
    means = [found.score(trial) for trial in found.trials]
    if not refine:
        assert len(means) == 9
        assert found.score(found.final.trial) == min(means)
        for fold in found.folds:
            seen = [name for name in NAMES if name != fold.held_out]
            assert fold.score == min(found.score(trial, seen) for trial in found.trials)
    assert found.score(found.final.trial) <= min(means[:9])
    held = [f.trial.outcomes[f.held_out].nrmse for f in found.folds]
    assert found.held_out_score == pytest.approx(np.mean(held))


def test_ties_go_to_the_defaults(tmp_path_factory, monkeypatch):
    found = searched(tmp_path_factory, lambda name, tuning: GOOD, monkeypatch)
    assert found.final.trial is found.default
    assert all(fold.trial is found.default for fold in found.folds)
    assert not found.pays


def test_a_broken_limit_disqualifies_where_it_is_seen_and_is_told_where_not(
    tmp_path_factory, monkeypatch
):
    def answer(name, tuning):
        outcome = replace(GOOD, nrmse=0.5 if tuning.weight_position == 2.8 else 0.4)
        if name == "a" and tuning.weight_position != 2.8:
            return replace(outcome, violations=2, broken="leg speed")
        return outcome

    found = searched(tmp_path_factory, answer, monkeypatch)
    assert found.final.trial is found.default
    assert "2 samples beyond a limit on a (leg speed)" in found.objection(found.trials[3])
    by_name = {fold.held_out: fold.trial for fold in found.folds}
    assert by_name["b"] is by_name["c"] is found.default
    assert by_name["a"] is not found.default
    assert found.held_out_violations == 2


def test_no_trial_left_is_an_error(tmp_path_factory, monkeypatch):
    with pytest.raises(ConfigError, match="none of 9 trials keeps the limits"):
        searched(tmp_path_factory, lambda name, tuning: replace(GOOD, rejected=1), monkeypatch)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({}, ""),
        ({"nrmse": 9.0, "sickness": 9.0, "incongruence": 9.0}, ""),
        ({"violations": 1, "broken": "leg jerk"}, "1 samples beyond a limit on a (leg jerk)"),
        ({"rejected": 3}, "3 plans rejected"),
        ({"tilt_p99": 0.0577}, "tilts at 3.31 deg/s (p99), allowed are 3.30"),
        ({"tilt_p99": 0.0575}, ""),
        ({"rmse_heave": 0.26}, "RMSE of f_z"),
        ({"rmse_rates": 0.026}, "RMSE of turning"),
        ({"rmse_heave": 0.25, "rmse_rates": 0.025}, ""),
    ],
)
def test_what_is_not_for_sale(change, reason):
    told = objection({"a": replace(GOOD, **change)}, {"a": GOOD, "b": GOOD}, np.radians(3.0))
    assert told.startswith(reason)
    assert bool(told) == bool(reason)


def test_criteria():
    assert Criterion("rmse").score(GOOD) == 0.5
    assert Criterion("incongruence").score(GOOD) == 0.4
    assert Criterion("sickness", 2.0).score(GOOD) == pytest.approx(0.7)
    assert "weight 2 per m/s2" in Criterion("sickness", 2.0).meaning
    with pytest.raises(ConfigError, match=r"unknown 'mse'.*rmse, incongruence, sickness"):
        Criterion("mse")
    with pytest.raises(ConfigError, match="--sickness-weight"):
        Criterion("sickness", -1.0)


def test_keys_tell_apart_whatever_counts(tmp_path_factory, monkeypatch):
    from motionserver.evaluate.tune.cache import key_of
    from motionserver.evaluate.tune.outcome import Job

    found = searched(tmp_path_factory, lambda name, tuning: GOOD, monkeypatch, trials=2)
    job = Job(MACHINE, found.stretches[0], found.tuning, 0.6, 50.0)
    box = frozen(0.5 * found.tuning.box)
    others = [
        replace(job, machine=MACHINE.with_head(np.array([0.0, 0.0, 0.7]))),
        replace(job, stretch=found.stretches[1]),
        replace(job, wanted_scale=0.5),
        replace(job, planner_hz=100.0),
        replace(job, tuning=replace(found.tuning, weight_input=0.3)),
        replace(job, tuning=replace(found.tuning, box=box)),
    ]
    assert key_of(job) == key_of(replace(job))
    assert len({key_of(other) for other in [job, *others]}) == 7


def test_cache_survives_a_line_cut_short(tmp_path):
    path = tmp_path / "drives.jsonl"
    with ResultCache(path) as cache:
        cache.put("one", GOOD, "")
        cache.put("two", replace(GOOD, nrmse=0.1), "")
    whole = path.read_text()
    path.write_text(whole[:-30])
    with ResultCache(path) as cache:
        assert cache.get("one") == GOOD
        assert cache.get("two") is None
        cache.put("two", GOOD, "")
    with ResultCache(path) as cache:
        assert cache.get("two") == GOOD
