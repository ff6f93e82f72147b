"""A side engine: the live code on a platform of its own, contained, judged like the driving one."""

from dataclasses import replace

import numpy as np
import pytest

import motionserver.cueing.side as side_module
from motionserver.core.axes import GRAVITY, frozen
from motionserver.core.plan import rest_at
from motionserver.core.state import STILL, Stimulus
from motionserver.cueing.base import Report
from motionserver.cueing.classical import Classical
from motionserver.cueing.side import SideEngine
from motionserver.cueing.think import Thinker
from motionserver.cueing.tuning import Tuning
from motionserver.evaluate.drive import RATE_HZ
from motionserver.evaluate.lockstep import drive
from motionserver.evaluate.recording import from_samples

PERIOD = 0.01
TUNING = Tuning(scale=1.0)
PUSH = Stimulus(frozen([1.5, 0.0, 0.0]), frozen(np.zeros(3)))


def no_clock():
    return 0.0


def engine_of(machine, algorithm="classical", **more):
    homes = frozen(np.stack((np.zeros(6), machine.parked_pose)))
    return SideEngine(machine, TUNING, algorithm, PERIOD, homes, **more)


@pytest.mark.parametrize("algorithm", ["classical", "thondel2014"])
def test_it_does_what_the_driving_engine_does_in_lock_step(machine, algorithm):
    times = np.arange(300) * PERIOD
    force = np.column_stack((2.0 * np.sin(2.0 * times), np.cos(3.0 * times), GRAVITY + 0 * times))
    recording = from_samples("made", times, force, np.zeros((300, 3)), np.zeros(300))
    tuning = replace(TUNING, algorithm=algorithm)
    driven = drive(machine, recording, tuning)
    engine = SideEngine(machine, TUNING, algorithm, PERIOD, machine.parked_pose[None])
    felt, periods = [], driven.periods
    for wanted, rates in zip(periods.force, periods.rates, strict=True):
        engine.think(Stimulus(wanted, rates), no_clock)
        felt.append(engine.scores.felt)
    stride = round(RATE_HZ * PERIOD)
    expected = driven.felt()[0][::stride]
    count = len(expected) - 1
    assert count > 250
    np.testing.assert_allclose(felt[:count], expected[1:], atol=1e-6)
    figures = engine.scores.figures()
    assert figures.whole == pytest.approx(np.mean(periods.kappa == 1.0), abs=0.01)
    error = np.array(felt[:-1])[:, :2] - periods.force[1:, :2]
    assert figures.rmse == pytest.approx(np.sqrt(np.mean(error**2)), rel=0.05)


def test_a_skipped_period_passes_on_the_plan_it_has(machine):
    thinking, skipping = engine_of(machine), engine_of(machine)
    for _ in range(40):
        thinking.think(PUSH, no_clock)
        skipping.think(PUSH, no_clock)
    for _ in range(300):
        skipping.skip(STILL)
    assert skipping.counters["skipped"] == 300
    assert skipping.counters["periods"] == 340
    level = -GRAVITY * np.sin(skipping.scores.rest_pose[4])
    assert skipping.scores.felt[0] == pytest.approx(level, abs=1e-6)
    assert skipping.scores.figures().whole == 1.0
    # nothing jumps: the plan it has leads on
    before = thinking.scores.felt
    thinking.skip(PUSH)
    assert np.abs(thinking.scores.felt - before).max() < 1.0


def test_it_washes_out_when_nothing_is_wanted(machine):
    engine = engine_of(machine)
    for _ in range(100):
        engine.think(PUSH, no_clock)
    assert np.abs(engine.scores.rest_pose).max() > 0.01
    for _ in range(1500):
        engine.think(STILL, no_clock)
    assert np.abs(engine.scores.rest_pose).max() < 0.01
    engine.stand()
    engine.think(STILL, no_clock)
    np.testing.assert_array_equal(engine.scores.felt, np.zeros(3))


class Stumbles(Classical):
    """Raises, or proposes what is no number."""

    how = "raise"

    def propose(self, *arguments):
        if self.how == "raise":
            raise RuntimeError("lost")
        candidate = super().propose(*arguments)
        return replace(candidate, pose=candidate.pose * np.nan) if self.how == "nan" else None

    def report(self):
        return Report(frozen(np.ones(6)))


@pytest.mark.parametrize("how", ["raise", "nan", "none"])
def test_a_wrong_algorithm_is_contained_and_counted(machine, how):
    engine = engine_of(machine)
    sound = engine.cueing
    engine._thinker.cueing = Stumbles(machine, TUNING, PERIOD)
    engine._thinker.cueing.how = how
    engine.think(PUSH, no_clock)
    assert engine.trouble
    assert engine.counters["raised"] == (how == "raise")
    assert engine.scores.figures().none == 1.0
    engine._thinker.cueing = sound
    engine.think(PUSH, no_clock)
    assert engine.trouble == ""
    assert engine.scores.kappa == 1.0


def test_what_cannot_be_contained_by_the_thinker_is_contained_here(machine, monkeypatch):
    engine = engine_of(machine)

    def stumble(*_):
        raise RuntimeError("no thinker")

    monkeypatch.setattr(side_module.Thinker, "think", stumble)
    monkeypatch.setattr(side_module.Thinker, "retune", stumble)
    engine.think(PUSH, no_clock)
    engine.retune(TUNING)
    assert engine.counters["raised"] == 2
    assert engine.trouble == "RuntimeError: no thinker"


def test_it_goes_on_where_the_platform_is(machine):
    engine = engine_of(machine, cueing=Classical(machine, TUNING, PERIOD))
    pose = np.array([0.05, 0.0, 0.0, 0.0, 0.02, 0.0])
    engine.start_from(rest_at(pose, 77), 0.4)
    engine.skip(STILL)
    np.testing.assert_array_equal(engine.scores.rest_pose, pose)


def test_another_algorithm_takes_over_at_once_and_numbers_follow(machine):
    thinker = Thinker(machine, TUNING, PERIOD, machine.parked_pose[None])
    warm = Classical(machine, TUNING, PERIOD)
    target = replace(TUNING, algorithm="classical", scale=0.5)
    thinker.retune(target, warm)
    assert thinker.cueing is warm
    assert thinker.tuning.algorithm == "classical"
    assert thinker.tuning.scale == TUNING.scale
    parent, before = rest_at(np.zeros(6), 1), None
    for number in range(2, 120):
        thought = thinker.think(parent, before, PERIOD, PUSH, number)
        before, parent = parent, thought.proposal.plan
    assert thinker.tuning == target or thinker.tuning.scale == target.scale
    assert thinker.cueing is warm
    with pytest.raises(ValueError, match="magic"):
        thinker.retune(replace(target, algorithm="magic"))
    assert thinker.cueing is warm
    thinker.retune(replace(target, algorithm="thondel2014"))
    assert thinker.cueing.name == "thondel2014"
