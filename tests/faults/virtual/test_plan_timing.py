"""Plans that take about as long as there is time: hardly one is refused, and none grows old.

Planner and guard are the product's own loops on virtual time; only how long a plan takes is ours.
"""

import logging
from random import Random

import numpy as np
import pytest
import world as world_of
from fittings import fitted
from world import World

from motionserver.core.safety.states import State
from motionserver.cueing.governor import remainder

SETTLE = 5.0
"""The first seconds, in which the planner learns how long its plans take [s]."""


class StandingMind:
    """Proposes what remains of the accepted plan; it takes as long as it is told."""

    def __init__(self, cueing, world):
        self._cueing, self._world = cueing, world
        self.disturbance = np.zeros(3)

    def propose(self, start, parent, takeover, stimulus):
        self._world.think(self._world.pace(self._world.rng_of_pace, self._world.elapsed))
        return remainder(parent, takeover, 1)

    def __getattr__(self, name):
        return getattr(self._cueing, name)


class PacedWorld(World):
    def __init__(self, pace, seed, planner_hz):
        self.pace, self.rng_of_pace = pace, Random(seed)
        self.ages = []
        self._played = 0
        super().__init__(seed, planner_hz)
        self.watchers.append(self._look)

    def mind(self, cueing):
        return StandingMind(cueing, self)

    def _look(self):
        """A plan's number is the instant at which its inputs were read."""
        playback = self.record.playback
        if playback is None or not self.guard._sends or self.guard._sends[-1] != self.now:
            return
        number = playback.playing.plan.plan_id
        if number != self._played and number < 1 << 62 and playback.clock > 1e-6:
            self._played = number
            self.ages.append((self.now - number) * 1e-6)


class Outcome:
    """What became of the plans after the first seconds."""

    def __init__(self, world, seconds):
        logging.disable(logging.CRITICAL)
        world.start()
        world.engage()
        world.run(SETTLE)
        before, world.ages = world.counters.copy(), []
        states = set()
        world.watchers.append(lambda: states.add(world.state))
        world.run(seconds)
        logging.disable(logging.NOTSET)
        found = world.counters - before
        self.states = states
        self.refused = found["plans_rejected"]
        self.plans = self.refused + found["plans_accepted"]
        self.why = {k: v for k, v in found.items() if k.startswith("rejected_")}
        ages = sorted(world.ages)
        self.age, self.oldest = ages[len(ages) // 2], ages[int(0.99 * (len(ages) - 1))]
        self.rate = self.plans / seconds

    @property
    def share(self):
        return self.refused / self.plans

    def __str__(self):
        return (
            f"refused {100 * self.share:.2f} % of {self.plans}, reading to playing "
            f"{self.age:.1f} ms (99 %: {self.oldest:.1f}) {self.why} {sorted(self.states)}"
        )


def outcome(monkeypatch, pace, send_hz=60.0, planner_hz=60.0, seconds=20.0, seed=1):
    monkeypatch.setattr(world_of, "SEND_HZ", send_hz)
    world = PacedWorld(pace, seed, planner_hz)
    with fitted(world):
        return Outcome(world, seconds)


def about(mean, deviation):
    return lambda rng, _: max(0.5, rng.gauss(mean, deviation)) * 1e-3


def with_stalls(mean, deviation, share, stall):
    usual = about(mean, deviation)
    return lambda rng, now: usual(rng, now) + (stall * 1e-3 if rng.random() < share else 0.0)


def test_plans_as_long_as_the_time_for_them_are_played_young(monkeypatch):
    found = outcome(monkeypatch, about(9.4, 2.0), seconds=10.0)
    assert found.states == {State.RUN}
    assert found.plans > 590
    assert found.share < 0.01, str(found)
    assert found.age < 43.4, str(found)


@pytest.mark.parametrize("mean", [2.0, 6.0, 12.0, 14.0])
def test_plans_of_any_length_within_a_period_are_accepted(monkeypatch, mean):
    found = outcome(monkeypatch, about(mean, 1.0), seconds=10.0)
    assert found.states == {State.RUN}
    assert found.share < 0.02, str(found)
    assert found.age < mean + 3.0 + 1000 / 60 + 1.0, str(found)


def test_plans_longer_than_a_period_are_accepted_at_half_the_rate(monkeypatch):
    found = outcome(monkeypatch, about(19.0, 1.0), seconds=10.0)
    assert found.share < 0.02, str(found)
    assert found.rate > 28.0


def test_stalls_leave_the_other_plans_alone(monkeypatch):
    found = outcome(monkeypatch, with_stalls(5.0, 1.0, 0.01, 30.0), seconds=20.0)
    assert found.share < 0.02, str(found)
    assert found.age < 43.4, str(found)


def test_a_guard_that_checks_in_slices_gets_a_plan_in_every_period(monkeypatch):
    # 480 packets a second: a verdict takes 6 ms, so the next plan is begun before it
    found = outcome(monkeypatch, about(5.0, 0.5), send_hz=480.0, planner_hz=120.0, seconds=1.0)
    assert found.share < 0.02, str(found)
    assert found.rate > 110.0


def test_a_slow_hour_is_forgotten_when_plans_are_short_again(monkeypatch):
    def pace(rng, now):
        return (14.0 if now < 16.0 else 4.0) * 1e-3

    monkeypatch.setattr(world_of, "SEND_HZ", 60.0)
    world = PacedWorld(pace, 1, 60.0)
    with fitted(world):
        slow = Outcome(world, 5.0)
        world.run(10.0)
        world.ages.clear()
        world.run(2.0)
    assert slow.age > 14.0
    assert max(world.ages) < 7.0


@pytest.mark.campaign
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("send_hz", [60.0, 100.0, 240.0, 480.0])
@pytest.mark.parametrize("deviation", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("mean", [2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0, 16.0])
def test_campaign_of_rates_lengths_and_spreads(monkeypatch, send_hz, mean, deviation):
    # pytest -m campaign -s tests/faults/virtual/test_plan_timing.py
    planner_hz = send_hz / -(-send_hz // 120.0)
    pace = with_stalls(mean, deviation, 0.005, 20.0)
    found = outcome(monkeypatch, pace, send_hz, planner_hz, seconds=20.0)
    print(f"{send_hz:.0f} Hz, {mean:g} +- {deviation:g} ms: {found}")
    assert found.share < 0.02, str(found)
