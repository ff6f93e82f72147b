"""Which engines run beside, when they may think, and how they change places."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from machines import compact

from motionserver.core.axes import frozen
from motionserver.core.plan import rest_at
from motionserver.core.state import STILL, Stimulus
from motionserver.cueing.classical import Classical
from motionserver.cueing.registry import make_cueing
from motionserver.cueing.tuning import Tuning
from motionserver.planner.sides import RESERVE_NS, Sides
from motionserver.planner.spare_time import GUESS_NS, KEPT, PATIENCE_NS, Cost

MS = 1_000_000
PERIOD = 1 / 60
TUNING = Tuning(algorithm="thondel2014")
PUSH = Stimulus(frozen([1.0, 0.0, 0.0]), frozen(np.zeros(3)))
LATER = 10**15


class Clock:
    """Goes on by so much at every look."""

    def __init__(self, step=0):
        self.now, self.step = 0, step

    def __call__(self):
        self.now += self.step
        return self.now


def sides_of(*wanted, clock=None):
    machine = compact()
    homes = frozen(np.stack((np.zeros(6), machine.parked_pose)))
    sides = Sides(machine, PERIOD, homes, wanted, clock or Clock())
    for _ in wanted:
        sides.make_one(TUNING)
    return sides


def engines(sides, driving="thondel2014"):
    return {engine["name"]: engine for engine in sides.shown(driving)["engines"]}


def test_one_that_drives_does_not_run_a_second_time():
    sides = sides_of("thondel2014", "classical")
    sides.think(PUSH, LATER)
    assert set(sides.forces()) == {"classical"}
    assert list(engines(sides)) == ["classical"]
    assert sides.shown("thondel2014")["wanted"] == ["thondel2014", "classical"]


def test_engines_are_made_one_a_period():
    sides = Sides(compact(), PERIOD, compact().parked_pose[None], ("thondel2014", "classical"))
    tuning = replace(TUNING, algorithm="other")
    sides.make_one(tuning)
    assert set(sides.forces()) == {"thondel2014"}
    sides.make_one(tuning)
    assert set(sides.forces()) == {"thondel2014", "classical"}


def test_without_time_they_are_skipped_and_counted():
    sides = sides_of("classical")
    sides.think(PUSH, RESERVE_NS + GUESS_NS - 1)
    assert engines(sides)["classical"]["skipped"] == 1
    sides.think(PUSH, RESERVE_NS + GUESS_NS)
    figures = engines(sides)["classical"]
    assert (figures["skipped"], figures["periods"], figures["kappa"]) == (1, 2, 1.0)


def test_little_time_is_shared():
    clock = Clock(step=3 * MS)
    sides = sides_of("classical", "thondel2014", clock=clock)
    sides.make_one(replace(TUNING, algorithm="other"))
    for _ in range(10):
        begun = clock.now
        sides.think(PUSH, begun + 3 * MS + GUESS_NS + RESERVE_NS)
    counts = [e["skipped"] for e in engines(sides, "other").values()]
    assert counts == [5, 5]


def test_they_change_places_and_keep_what_was_learnt():
    sides = sides_of("classical")
    beside = sides.warm("classical")
    driving = make_cueing(compact(), TUNING, PERIOD)
    scores = sides.driving, sides._engines["classical"].scores
    target = replace(TUNING, algorithm="classical")
    pose = np.array([0.04, 0.0, 0.0, 0.0, 0.0, 0.0])
    sides.switched(target, "thondel2014", driving, rest_at(pose, 5), 0.2)
    assert isinstance(beside, Classical)
    assert sides.wanted == ("thondel2014",)
    assert sides.warm("thondel2014") is driving
    assert sides.warm("classical") is None
    assert sides.switches == 1
    assert (sides._engines["thondel2014"].scores, sides.driving) == scores
    sides.think(STILL, LATER)
    assert engines(sides, "classical")["thondel2014"]["rest_pose"][0] == pytest.approx(
        0.04, abs=0.02
    )


def test_a_switch_to_one_that_is_not_beside_leaves_the_others_alone():
    sides = sides_of()
    sides.switched(replace(TUNING, algorithm="classical"), "thondel2014", None, None, 0.0)
    assert sides.wanted == ()
    assert engines(sides, "classical") == {}


def test_one_in_trouble_is_not_taken_over():
    sides = sides_of("classical")
    assert sides.warm("classical") is not None
    sides._engines["classical"].trouble = "RuntimeError: lost"
    assert sides.warm("classical") is None


def test_one_that_cannot_be_made_is_said_and_tried_again_with_another_tuning():
    sides = Sides(compact(), PERIOD, compact().parked_pose[None], ("thondel2014",))
    tuning = replace(TUNING, algorithm="classical", backend="nonsense")
    for _ in range(3):
        sides.make_one(tuning)
    assert "nonsense" in engines(sides, "classical")["thondel2014"]["trouble"]
    tuning = replace(tuning, backend="daqp")
    sides.retune(tuning)
    sides.make_one(tuning)
    assert engines(sides, "classical")["thondel2014"]["trouble"] == ""


def test_those_not_wanted_any_more_end():
    sides = sides_of("classical")
    sides.want(())
    assert sides.forces() == {}
    assert engines(sides) == {}


def test_they_stand_at_neutral_while_the_platform_is_not_cued():
    sides = sides_of("classical")
    for _ in range(60):
        sides.think(PUSH, LATER)
    assert abs(sides.forces()["classical"][0][0]) > 0.1
    sides.stand()
    sides.think(STILL, LATER)
    np.testing.assert_array_equal(sides.forces()["classical"][0], np.zeros(3))


def test_a_cost_is_its_95th_percentile():
    cost = Cost()
    for k in range(KEPT):
        cost.took(k, (20 if k % 25 == 0 else 2) * MS)
    assert cost.fits(0, 2 * MS)
    for k in range(10):
        cost.took(k, 20 * MS)
    assert not cost.fits(0, 19 * MS)
    assert cost.fits(0, 20 * MS)


def test_too_slow_is_tried_again_ever_more_seldom():
    cost = Cost()
    cost.took(0, 20 * MS)
    tries, now = [], 0
    while now < 700_000_000_000:
        now += 500 * MS
        if cost.fits(now, 10 * MS):
            tries.append(now // 1_000_000_000)
            cost.took(now, 20 * MS)
    gaps = np.diff([0, *tries]).tolist()
    assert gaps[0] == PATIENCE_NS // 1_000_000_000
    assert all(later == 2 * sooner for sooner, later in pairwise(gaps))
    assert not cost.fits(now + 10**15, 0)
