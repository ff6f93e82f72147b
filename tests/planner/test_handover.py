"""Where the next plan takes over: the guard's clock, and what is learnt from missing it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from motionserver.core.axes import frozen
from motionserver.core.motion.player import MOST_PENDING
from motionserver.core.plan import Plan, pack, rest_at
from motionserver.core.safety.states import State
from motionserver.core.safety.verdict import Reason
from motionserver.core.safety.verify import CLOSEST
from motionserver.planner.handover import Handover, HandoverClock
from motionserver.telemetry.link import REASONS, STATES, GuardClock, Maps

MS = 1_000_000
ALIVE_NS, FALL_NS = 200 * MS, 2000 * MS
PERIOD = 1 / 60


class Scene:
    def __init__(self, folder: Path) -> None:
        self.maps = Maps(folder, create=True)
        self.clock = HandoverClock(self.maps, PERIOD)
        self.late = 0

    def guard(
        self,
        state: State,
        newest: Plan,
        at: float = 0.0,
        now: int = 0,
        judged: int = 0,
        why: Reason | None = None,
        taken: int = 0,
    ) -> None:
        self.late += why is Reason.TOO_LATE
        self.maps.accepted.write(pack(newest))
        due = now + int(PERIOD * 1e9)
        code = 0 if why is None else 1 + REASONS.index(why)
        clock = GuardClock(
            STATES.index(state),
            newest.plan_id,
            at,
            now,
            due,
            now,
            taken,
            judged,
            code,
            0,
            self.late,
        )
        self.maps.clock.write(clock.pack())

    def handover(self, now: int = 0, ready: int = 0) -> Handover | None:
        self.clock.read(now)
        return self.clock.handover(now, ready)


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
    assert scene.clock.clock is None
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


OURS = 100


def refused(scene: Scene, why: Reason, count: int) -> None:
    """The guard has refused so many proposals, one a period."""
    for k in range(count):
        scene.clock.proposed(plan(OURS + k, 5), k * MS)
        scene.guard(State.RUN, rest_at(np.zeros(6), 5), judged=OURS + k, why=why)
        scene.handover(k * MS)


def test_a_plan_too_late_aims_further_but_never_as_far_as_the_guard_lets_plans_wait(
    scene: Scene,
) -> None:
    scene.guard(State.RUN, rest_at(np.zeros(6), 5))
    scene.handover()
    refused(scene, Reason.TOO_LATE, 8)
    assert scene.clock.last_refusal is Reason.TOO_LATE
    for ready_ms in (0, 17, 34, 200):
        found = scene.handover(0, ready_ms * MS)
        assert found is not None
        assert found.takeover < MOST_PENDING * PERIOD


@pytest.mark.parametrize("why", [one for one in Reason if one is not Reason.TOO_LATE])
def test_a_plan_refused_for_another_reason_is_no_late_plan(scene: Scene, why: Reason) -> None:
    scene.guard(State.RUN, rest_at(np.zeros(6), 5))
    scene.handover()
    refused(scene, why, 8)
    assert scene.clock.lead == 0
    assert scene.clock.shown()["last_refusal"] == why


def test_the_lead_falls_by_time_whatever_else_is_refused(scene: Scene) -> None:
    scene.guard(State.RUN, rest_at(np.zeros(6), 5))
    scene.handover()
    refused(scene, Reason.TOO_LATE, 2)
    assert scene.clock.lead == 2
    for k in range(1, 8):
        now = MS + k * FALL_NS // 4
        why = Reason.TOO_EARLY if k % 2 else Reason.WRONG_PARENT
        scene.guard(State.RUN, rest_at(np.zeros(6), 5), now=now, judged=200 + k, why=why)
        scene.handover(now)
        assert scene.clock.lead == (2 if k < 4 else 1)


def test_a_guard_that_counts_anew_is_no_late_plan(scene: Scene) -> None:
    scene.late = 7
    scene.guard(State.RUN, rest_at(np.zeros(6), 5))
    scene.handover()
    assert scene.clock.lead == 0
    scene.late = 0
    scene.guard(State.RUN, rest_at(np.zeros(6), 5))
    scene.handover()
    assert scene.clock.lead == 0
    refused(scene, Reason.TOO_LATE, 1)
    assert scene.clock.lead == 1


def test_a_slot_reached_by_adding_periods_is_not_missed_by_rounding(scene: Scene) -> None:
    # the guard adds its period at every send: what it has then must not lie past the instant
    at = 0.4
    scene.guard(State.RUN, rest_at(np.zeros(6), 5), at=at)
    found = scene.handover(0, 33 * MS)
    assert found is not None
    assert found.takeover - (at + PERIOD) == pytest.approx(1e-8, rel=1e-3)


def in_time(plan_id: int, parent: int, takeover: float) -> Plan:
    return replace(plan(plan_id, parent), takeover=takeover)


def test_a_proposal_without_a_verdict_is_continued_if_it_is_in_time(scene: Scene) -> None:
    scene.guard(State.RUN, rest_at(np.zeros(6), 5), at=0.4)
    scene.handover()
    scene.clock.proposed(in_time(6, 5, 0.4 + PERIOD), 0)
    found = scene.handover(1 * MS, 1 * MS)
    assert found is not None
    assert (found.parent.plan_id, found.before and found.before.plan_id) == (6, 5)
    # it waits a period for its own instant: two periods of it are those after the next send
    found = scene.handover(1 * MS, 20 * MS)
    assert found is not None
    assert found.takeover == pytest.approx(CLOSEST)


def test_a_proposal_that_will_come_too_late_is_not_continued(scene: Scene) -> None:
    scene.guard(State.RUN, rest_at(np.zeros(6), 5), at=0.4)
    scene.handover()
    scene.clock.proposed(in_time(6, 5, 0.4 - PERIOD), 0)
    found = scene.handover(1 * MS)
    assert found is not None
    assert found.parent.plan_id == 5


def test_a_refused_proposal_is_not_continued_and_neither_is_its_child(scene: Scene) -> None:
    scene.guard(State.RUN, rest_at(np.zeros(6), 5), at=0.4)
    scene.handover()
    scene.clock.proposed(in_time(6, 5, 0.4 + PERIOD), 0)
    scene.clock.proposed(in_time(7, 6, 0.02), 1 * MS)
    scene.guard(
        State.RUN, rest_at(np.zeros(6), 5), at=0.4, now=2 * MS, judged=6, why=Reason.LEG_JERK
    )
    found = scene.handover(2 * MS)
    assert found is not None
    assert found.parent.plan_id == 5


def test_two_proposals_without_a_verdict_are_waited_for(scene: Scene) -> None:
    scene.guard(State.RUN, rest_at(np.zeros(6), 5), at=0.4)
    scene.handover()
    scene.clock.proposed(in_time(6, 5, 0.4 + PERIOD), 0)
    scene.clock.proposed(in_time(7, 6, 0.02), 1 * MS)
    assert scene.handover(2 * MS) is None
    assert scene.clock.waited == 1
    scene.guard(State.RUN, in_time(6, 5, 0.4 + PERIOD), at=-PERIOD, now=3 * MS, judged=6)
    found = scene.handover(3 * MS)
    assert found is not None
    assert found.parent.plan_id == 7


def test_a_proposal_that_nobody_will_decide_about_is_given_up(scene: Scene) -> None:
    scene.guard(State.RUN, rest_at(np.zeros(6), 5), at=0.4)
    scene.handover()
    scene.clock.proposed(in_time(6, 5, 0.5), 0)
    for now, parent in ((16 * MS, 6), (17 * MS, 5)):
        scene.guard(State.RUN, rest_at(np.zeros(6), 5), at=0.4, now=now)
        found = scene.handover(now)
        assert found is not None
        assert found.parent.plan_id == parent


def test_a_plan_is_held_back_while_it_would_replace_its_own_parent(scene: Scene) -> None:
    scene.guard(State.RUN, rest_at(np.zeros(6), 5), at=0.4)
    scene.handover()
    scene.clock.proposed(in_time(6, 5, 0.5), 0)
    child = in_time(7, 6, 0.02)
    assert not scene.clock.may_propose(child, 8_333_332)
    # two ticks at 240 Hz: a guard that ticks has read it by then
    assert scene.clock.may_propose(child, 8_333_333)
    assert scene.clock.may_propose(in_time(7, 5, 0.5), 0)
    scene.guard(State.RUN, rest_at(np.zeros(6), 5), at=0.4, taken=6)
    assert scene.clock.may_propose(child, 0)


def test_only_the_newest_proposals_are_remembered(scene: Scene) -> None:
    for k in range(10, 60):
        scene.clock.proposed(plan(k, k - 1))
    assert len(scene.clock._plans) == 16
    assert max(scene.clock._plans) == 59


def test_before_a_guard_is_heard_there_is_little_to_show(scene: Scene) -> None:
    assert scene.clock.shown() == {
        "lead_slots": 0,
        "last_refusal": None,
        "waiting": 0,
        "periods_waited": 0,
    }
    assert not scene.clock.may_propose(plan(6, 5), 0)


def test_what_the_page_tells_of_the_hand_over(scene: Scene) -> None:
    scene.guard(State.RUN, rest_at(np.zeros(6), 5))
    scene.handover()
    refused(scene, Reason.TOO_LATE, 1)
    scene.clock.proposed(plan(200, 5), MS)
    scene.clock.proposed(plan(201, 200), MS)
    rest = rest_at(np.zeros(6), 5)
    clock = GuardClock(STATES.index(State.RUN), 5, 0.0, 0, 16 * MS, MS, waiting=2, late_count=1)
    scene.maps.accepted.write(pack(rest))
    scene.maps.clock.write(clock.pack())
    assert scene.handover(MS) is None
    assert scene.clock.shown() == {
        "lead_slots": 1,
        "last_refusal": Reason.TOO_LATE,
        "waiting": 2,
        "periods_waited": 1,
    }


def test_before_a_plan_was_accepted_there_is_no_parent(scene: Scene) -> None:
    scene.maps.clock.write(GuardClock(STATES.index(State.RUN), 5, 0.0, 0, 16 * MS, 0).pack())
    assert scene.handover() is None
    scene.maps.accepted.write(pack(rest_at(np.zeros(6), 5)))
    assert scene.handover() is not None


@pytest.mark.parametrize(
    ("periods", "slots"), [(None, 2), (1.0, 2), (0.25, 2), (2.0, 5), (4.0, 11)]
)
def test_no_plan_waits_longer_than_the_guard_lets_plans_wait(
    scene: Scene, periods: float | None, slots: int
) -> None:
    scene.guard(State.RUN, rest_at(np.zeros(6), 5), at=0.4)
    clock = HandoverClock(scene.maps, PERIOD, None if periods is None else periods * PERIOD)
    clock.read(0)
    found = clock.handover(0, 1000 * MS)
    assert found is not None
    assert found.takeover == pytest.approx(0.4 + slots * PERIOD)


def test_a_lead_is_so_many_slots_further(scene: Scene) -> None:
    scene.guard(State.RUN, rest_at(np.zeros(6), 5))
    scene.handover()
    refused(scene, Reason.TOO_LATE, 1)
    scene.guard(State.RUN, rest_at(np.zeros(6), 5), at=0.4, judged=OURS)
    found = scene.handover()
    assert found is not None
    assert found.takeover == pytest.approx(0.4 + PERIOD)


def test_a_lead_falls_two_seconds_after_it_rose_or_fell(scene: Scene) -> None:
    def lead(at_ns: int, judged: int = 0, why: Reason | None = None) -> int:
        scene.guard(State.RUN, rest_at(np.zeros(6), 5), now=at_ns, judged=judged, why=why)
        scene.handover(at_ns)
        return scene.clock.lead

    begin = 10_000 * MS
    assert lead(begin) == 0
    for k in range(2):
        scene.clock.proposed(plan(OURS + k, 5), begin)
        assert lead(begin, OURS + k, Reason.TOO_LATE) == k + 1
    assert [lead(begin + 2000 * MS + ns) for ns in (-1, 0)] == [2, 1]
    assert [lead(begin + 4000 * MS + ns) for ns in (-1, 0)] == [1, 0]
    assert lead(begin + 9000 * MS) == 0


def test_the_last_refusal_is_kept_when_a_plan_is_accepted(scene: Scene) -> None:
    scene.guard(State.RUN, rest_at(np.zeros(6), 5))
    scene.handover()
    refused(scene, Reason.LEG_JERK, 1)
    scene.guard(State.RUN, rest_at(np.zeros(6), 5))
    scene.handover()
    assert scene.clock.last_refusal is Reason.LEG_JERK


@pytest.mark.parametrize(("check_ms", "patience_ns"), [(0, 16_666_667), (5, 26_666_667)])
def test_a_verdict_is_waited_for_a_period_and_twice_the_check(
    scene: Scene, check_ms: int, patience_ns: int
) -> None:
    known = {"check_ns": check_ms * MS} if check_ms else {}
    clock = HandoverClock(scene.maps, PERIOD, **known)
    for late, parent in ((0, 6), (1, 5)):
        scene.guard(State.RUN, rest_at(np.zeros(6), 5), at=0.4, now=10 * MS)
        clock.read(10 * MS)
        # of now, or of the last reading
        clock.proposed(in_time(6, 5, 0.6), *((10 * MS,) if late else ()))
        now = 10 * MS + patience_ns + late
        scene.guard(State.RUN, rest_at(np.zeros(6), 5), at=0.4, now=now)
        clock.read(now)
        found = clock.handover(now, 0)
        assert found is not None
        assert found.parent.plan_id == parent


@pytest.mark.parametrize(
    ("check_ms", "now_ms", "slots"), [(0, 1, 0), (15, 1, 0), (20, 1, 1), (20, 35, 2), (40, 1, 2)]
)
@pytest.mark.parametrize(("early", "parent"), [(0.0, 6), (1e-9, 5)])
def test_a_proposal_is_continued_if_it_is_in_time_when_it_is_decided_about(
    scene: Scene, check_ms: int, now_ms: int, slots: int, early: float, parent: int
) -> None:
    """The next packet is due in 16.7 ms; a verdict comes after the check, or now if it is over."""
    clock = HandoverClock(scene.maps, PERIOD, check_ns=check_ms * MS)
    scene.guard(State.RUN, rest_at(np.zeros(6), 5), at=0.5)
    clock.read(0)
    clock.proposed(in_time(6, 5, 0.5 + slots * PERIOD - early), 0)
    clock.read(now_ms * MS)
    found = clock.handover(now_ms * MS, 0)
    assert found is not None
    assert found.parent.plan_id == parent


def test_a_proposal_that_continues_another_plan_is_no_parent(scene: Scene) -> None:
    scene.guard(State.RUN, rest_at(np.zeros(6), 5), at=0.4)
    scene.handover()
    scene.clock.proposed(in_time(6, 4, 0.6), 0)
    found = scene.handover(MS)
    assert found is not None
    assert found.parent.plan_id == 5
