"""Every fault of the list with three seeds: soft, in time, and ended safe."""

from functools import cache

import pytest
from account import Account
from fault_list import FAULTS
from fault_pairs import pairs_of
from fittings import fitted
from scenario import Scene
from table import markdown
from world import World

from motionserver.core.safety.states import State

SECONDS = 20.0
SEEDS = (1, 2, 3)
WITH_MPC = (1, 13, 21)
"""Faults whose third seed is driven by the six-axis MPC, as shipped."""
PLANNER_HZ = (60.0, 30.0, 30.0)
"""By seed; half as many plans take half as long to play."""


def planner_hz(seed):
    return PLANNER_HZ[seed % len(PLANNER_HZ)]


def scene(number, seed, **more):
    """The cheapest algorithm for most, the shipped one for a few."""
    shipped = number in WITH_MPC and seed == SEEDS[-1]
    algorithm = "mpc" if shipped else "classical"
    return Scene([FAULTS[number]], seed, SECONDS, planner_hz(seed), algorithm, **more)


@cache
def undisturbed(seed):
    """What is sent when nothing happens."""
    return Scene([FAULTS[18]], seed, SECONDS, planner_hz(seed), calm=True).play().digest


def judged(outcome):
    assert outcome.problems == [], outcome.states
    assert outcome.violations == 0
    assert outcome.late == [], outcome.states


def test_the_list_is_whole():
    assert sorted(FAULTS) == list(range(1, 39))
    for number, cls in FAULTS.items():
        assert cls.__name__ == f"F{number}"
        assert all((cls.title, cls.detection, cls.reaction, cls.recovery))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("number", sorted(FAULTS), ids=lambda n: f"F{n}")
def test_a_fault_is_answered_softly_and_in_time(number, seed):
    is_unseen = getattr(FAULTS[number], "is_unseen", False)
    outcome = scene(number, seed, is_brief=not is_unseen).play()
    judged(outcome)
    if is_unseen:
        assert outcome.digest == undisturbed(seed)


def test_a_scene_is_the_same_again_to_the_byte():
    first, second = (scene(13, 5).play() for _ in range(2))
    assert first == second


@pytest.mark.parametrize("two", pairs_of(seed=1, count=4), ids=lambda t: f"F{t[0]}-F{t[1]}")
def test_two_faults_at_once(two):
    outcome = Scene([FAULTS[n] for n in two], 1, SECONDS, is_brief=True).play()
    assert outcome.problems == [], outcome.states
    assert outcome.violations == 0


def test_the_account_convicts_a_jump():
    """What judges is itself judged: a setpoint that jumps is seen by both."""
    world = World(1)
    with fitted(world):
        world.start()
        world.engage()
        assert world.account.problems() == []
        inner = world.account.sent

        def jumping(data, setpoint):
            Account.sent(world.account, data, setpoint)
            world.account.sent = inner
            pose = setpoint.state.pose.copy()
            pose[0] += 0.02
            world.account._stretches[-1][-1] = (pose, setpoint.legs)

        world.account.sent = jumping
        world.run(0.2)
        assert world.state is State.RUN
        assert any("other kinematics" in text for text in world.account.problems())


def test_a_short_gap_of_the_guard_is_only_an_event():
    outcome = Scene([FAULTS[20]], 2, SECONDS).play()
    assert outcome.problems == []


def test_a_hasty_reset_after_the_platform_did_not_follow():
    played = Scene([FAULTS[13]], 1, SECONDS)
    played.is_hasty = True
    judged(played.play())


def test_the_table_tells_figures():
    outcome = {
        "names": ["F10"],
        "took": {"F10": 0.1},
        "bounds": {"F10": 0.125},
        "violations": 0,
    }
    text = markdown([outcome])
    assert "| F10 platform silent |" in text
    assert "| 125 ms | 100 ms | 100 ms | 1 | 0 |" in text


def test_the_table_tells_which_violations_were_foreseen():
    pair = {"names": ["F13", "F24"], "took": {}, "bounds": {}, "violations": 6}
    calm = {"names": ["F1", "F2"], "took": {}, "bounds": {}, "violations": 0}
    assert "6 of them are foreseen, F13 with F24: a leg is stuck" in markdown([pair, calm])
    assert "foreseen" not in markdown([calm])
