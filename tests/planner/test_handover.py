"""Where the next plan takes over: the guard's clock, and what is learnt from missing it."""

from pathlib import Path

import numpy as np
import pytest

from motionserver.core.axes import frozen
from motionserver.core.plan import Plan, pack, rest_at
from motionserver.core.safety.states import State
from motionserver.core.safety.verify import CLOSEST
from motionserver.planner.handover import ALIVE_NS, CONFIDENCE, KEPT, MOST_LEAD, HandoverClock
from motionserver.telemetry.link import STATES, GuardClock, Maps

MS = 1_000_000
PERIOD = 1 / 60


class Scene:
    def __init__(self, folder: Path) -> None:
        self.maps = Maps(folder, create=True)
        self.clock = HandoverClock(self.maps, PERIOD)

    def guard(self, state: State, newest: Plan, at: float = 0.0, now: int = 0) -> None:
        self.maps.accepted.write(pack(newest))
        due = now + int(PERIOD * 1e9)
        clock = GuardClock(STATES.index(state), newest.plan_id, at, now, due, now)
        self.maps.clock.write(clock.pack())


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    return Scene(tmp_path)


def plan(plan_id: int, parent: int) -> Plan:
    rest = rest_at(np.zeros(6), plan_id)
    return Plan(plan_id, parent, 0.0, frozen([0.0, 1.0]), rest.pose, rest.velocity, rest.velocity)


def test_no_guard_has_spoken(scene: Scene) -> None:
    assert scene.clock.read(0) is None
    assert scene.clock.handover(0, 0) is None


def test_a_guard_that_fell_silent_is_none(scene: Scene) -> None:
    scene.guard(State.RUN, rest_at(np.zeros(6), 5))
    assert scene.clock.read(ALIVE_NS) is State.RUN
    assert scene.clock.read(ALIVE_NS + 1) is None
    assert scene.clock.handover(ALIVE_NS + 1, 0) is None


@pytest.mark.parametrize("state", [State.PARKED, State.RAISING, State.PARKING, State.FAULT])
def test_nothing_takes_over_where_no_plans_are_played(scene: Scene, state: State) -> None:
    scene.guard(state, rest_at(np.zeros(6), 5))
    assert scene.clock.read(0) is state
    assert scene.clock.handover(0, 0) is None


@pytest.mark.parametrize(
    ("ready_ms", "slots"), [(1.0, 0), (16.6, 0), (17.0, 1), (33.0, 1), (34.0, 2)]
)
def test_the_instant_is_the_first_slot_the_plan_can_meet(
    scene: Scene, ready_ms: float, slots: int
) -> None:
    scene.guard(State.RUN, rest_at(np.zeros(6), 5), at=0.4)
    scene.clock.read(0)
    found = scene.clock.handover(0, int(ready_ms * MS))
    assert found is not None
    assert found.parent.plan_id == 5
    assert found.takeover == pytest.approx(0.4 + slots * PERIOD)


def test_while_the_guard_stands_still_nothing_is_planned(scene: Scene) -> None:
    scene.guard(State.RUN, rest_at(np.zeros(6), 5))
    due, stands = int(PERIOD * 1e9), 20 * MS
    for now, planned in [(due, True), (due + stands, True), (due + stands + 1, False)]:
        scene.clock.read(now)
        assert (scene.clock.handover(now, 0) is not None) == planned
    # a slow platform's guard may be a slot behind
    slow = HandoverClock(scene.maps, 0.1)
    slow.read(due + 100 * MS)
    assert slow.handover(due + 100 * MS, 0) is not None


def test_a_plan_just_taken_over_is_left_to_play_a_little(scene: Scene) -> None:
    scene.clock.proposed(plan(5, 4))
    scene.clock.proposed(plan(6, 5))
    scene.guard(State.RUN, plan(6, 5), at=-PERIOD)
    scene.clock.read(0)
    found = scene.clock.handover(0, 0)
    assert found is not None
    assert found.takeover == CLOSEST
    assert found.before is not None
    assert found.before.plan_id == 5


def test_a_plan_that_cannot_be_read_yet_is_waited_for(scene: Scene) -> None:
    scene.guard(State.RUN, rest_at(np.zeros(6), 5))
    clock = GuardClock(STATES.index(State.RUN), 6, 0.0, 0, MS, 0)
    scene.maps.clock.write(clock.pack())
    scene.clock.read(0)
    assert scene.clock.handover(0, 0) is None


def test_missing_aims_further_and_meeting_long_aims_nearer(scene: Scene) -> None:
    parent = rest_at(np.zeros(6), 5)
    scene.guard(State.RUN, parent)
    scene.clock.read(0)
    scene.clock.handover(0, 0)
    assert scene.clock.lead == 0
    scene.clock.proposed(plan(6, 5))
    for k in range(6):
        scene.clock.handover(0, 0)
        assert scene.clock.lead == min(k + 1, MOST_LEAD)
    scene.guard(State.RUN, plan(6, 5), at=0.5)
    scene.clock.read(0)
    for _ in range(CONFIDENCE):
        scene.clock.handover(0, 0)
    assert scene.clock.lead == MOST_LEAD
    found = scene.clock.handover(0, 0)
    assert scene.clock.lead == MOST_LEAD - 1
    assert found is not None
    assert found.takeover == pytest.approx(0.5 + (MOST_LEAD - 1) * PERIOD)


def test_only_the_newest_proposals_are_remembered(scene: Scene) -> None:
    for k in range(10, 60):
        scene.clock.proposed(plan(k, k - 1))
    assert len(scene.clock._plans) == KEPT
    assert max(scene.clock._plans) == 59
