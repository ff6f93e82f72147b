"""What engage, park and reset are answered, and what they wish."""

import numpy as np
import pytest
from machines import compact
from own_kinematics import lengths

from motionserver.core.axes import frozen
from motionserver.core.device import Feedback, Phase
from motionserver.core.motion.moves import rest_to_rest
from motionserver.core.motion.player import Playback
from motionserver.core.safety.edges import edges, judge_reset
from motionserver.core.safety.given import GuardConfig, Request, TickInput
from motionserver.core.safety.record import GuardRecord
from motionserver.core.safety.states import Event, State
from motionserver.core.safety.supervisor import Supervisor
from motionserver.core.safety.verdict import AcceptedPlan
from motionserver.core.safety.watchdog import CueStatus, Patience

NOW = 5_000_000_000
ZERO = frozen(np.zeros(6))
MOVE = AcceptedPlan(rest_to_rest(2, 1, 0.0, ZERO, frozen([0.01] * 6), 1.0), None, 1.0)


class Scene:
    """A guard of which nobody asked anything yet; its device is down, its source fresh."""

    def __init__(self, state=State.PARKED, **config):
        self.config = GuardConfig(compact(), 1 / 60, 0.0125, **config)
        self.record = GuardRecord(state)
        self.supervisor = Supervisor(compact(), Patience(), 1 / 60, 0.0125)
        legs = lengths(compact(), ZERO)[0]
        self.supervisor.device.answered(Feedback(NOW, Phase.DOWN, "PARKED", legs))
        self.supervisor.source.update(NOW, CueStatus(NOW, 150_000_000))

    def ask(self, *requests):
        requests = tuple(r if isinstance(r, Request) else Request(r, "console") for r in requests)
        given = TickInput(NOW, 0.004, is_due=False, requests=requests)
        return edges(self.config, self.record, self.supervisor, given)


def test_engaging_is_granted_where_all_is_well():
    scene = Scene()
    assert scene.ask("engage") == (("",), {Event.ENGAGE})
    assert scene.record.counters == {"request_engage": 1}
    assert not scene.record.engaged_once


def test_who_asks_for_nothing_is_answered_nothing():
    scene = Scene()
    assert scene.ask() == ((), frozenset())
    assert not scene.record.counters


def test_what_is_refused_is_counted_and_wishes_nothing():
    scene = Scene()
    scene.record.leaving = True
    assert scene.ask("engage") == (("the service is ending",), frozenset())
    assert scene.record.counters == {"request_engage": 1, "request_refused": 1}


def test_an_unknown_request_is_told_what_is_known():
    scene = Scene()
    answers, wishes = scene.ask("dance")
    assert answers == ("unknown request 'dance'; allowed: engage, park, reset",)
    assert not wishes
    assert scene.record.counters == {"request_dance": 1, "request_refused": 1}


def test_parking_is_granted_wherever_the_platform_is_down_or_comes_down():
    for state in set(State) - {State.OFFLINE, State.SAFE}:
        assert Scene(state).ask("park") == (("",), {Event.PARK})


@pytest.mark.parametrize(
    ("state", "said"),
    [
        (State.OFFLINE, "the device does not answer; it is parked as soon as it answers"),
        (State.SAFE, "once it is closed and the cause is gone, reset: that parks"),
        (State.FAULT, "it cannot go home by itself: no way"),
    ],
)
def test_parking_is_refused_where_nothing_would_follow(state, said):
    scene = Scene(state)
    scene.supervisor.return_decision.wait_again("no way")
    answers, wishes = scene.ask("park")
    assert said in answers[0]
    assert not wishes
    assert scene.record.counters == {"request_park": 1, "request_refused": 1}


def test_parking_is_granted_in_a_fault_that_parks_by_itself():
    scene = Scene(State.FAULT)
    scene.supervisor.return_decision.decide(None, True, False, NOW)
    assert scene.supervisor.return_decision.status
    assert scene.ask("park") == (("",), {Event.PARK})


def test_what_a_former_fault_waited_for_forbids_no_parking():
    scene = Scene(State.RUN)
    scene.supervisor.return_decision.wait_again("no way")
    assert scene.ask("park") == (("",), {Event.PARK})


def test_every_request_of_a_tick_has_its_answer_in_order():
    answers, wishes = Scene().ask("reset", "engage", "park", "reset")
    assert [bool(answer) for answer in answers] == [True, False, False, True]
    assert wishes == {Event.ENGAGE, Event.PARK}


@pytest.mark.parametrize("engage", ["console", "http", "auto"])
def test_the_console_may_always_engage_and_needs_no_enable_input(engage):
    scene = Scene(engage=engage)
    scene.record.engaged_once = True
    assert scene.ask(Request("engage", "console", enabled=False))[0] == ("",)


def test_http_engages_where_it_is_told_so_and_somebody_holds_the_enable_input():
    by_http = Request("engage", "http")
    assert Scene(engage="http").ask(by_http) == (("",), {Event.ENGAGE})
    assert Scene().ask(by_http)[0] == ("engaging by http is off: [operator] engage = 'console'",)
    assert Scene(engage="http").ask(Request("engage", "http", enabled=False))[0] == (
        "the enable input is open: somebody at the platform must hold it",
    )


def test_auto_engages_by_itself_once():
    scene = Scene(engage="auto")
    assert scene.ask() == ((), {Event.ENGAGE})
    assert scene.record.engaged_once
    assert scene.ask() == ((), frozenset())


def test_auto_keeps_its_edge_until_engaging_is_possible():
    scene = Scene(State.OFFLINE, engage="auto")
    assert scene.ask() == ((), frozenset())
    scene.record.state = State.PARKED
    assert scene.ask() == ((), {Event.ENGAGE})


@pytest.mark.parametrize("engage", ["console", "http"])
def test_nobody_else_engages_by_itself(engage):
    assert Scene(engage=engage).ask() == ((), frozenset())


@pytest.mark.parametrize("state", [State.FAULT, State.SAFE])
@pytest.mark.parametrize("clock", [None, 1.0])
def test_a_reset_is_tried_for_two_seconds_and_forgets_what_the_guard_found(state, clock):
    scene = Scene(state)
    scene.record.playback = None if clock is None else Playback(MOVE, clock)
    scene.supervisor.inconsistent, scene.supervisor.astray = "no way home", True
    assert scene.ask("reset") == (("",), frozenset())
    assert scene.record.reset_until_ns == NOW + 2_000_000_000
    assert scene.supervisor.inconsistent == ""
    assert scene.supervisor.astray is False


def test_a_reset_waits_for_the_end_of_the_motion():
    scene = Scene(State.FAULT)
    scene.record.playback = Playback(MOVE, 0.999)
    scene.supervisor.inconsistent, scene.supervisor.astray = "no way home", True
    assert scene.ask("reset")[0] == ("the platform still moves; reset when it stands",)
    assert scene.record.reset_until_ns == 0
    assert scene.supervisor.inconsistent == "no way home"
    assert scene.supervisor.astray


@pytest.mark.parametrize("state", sorted(set(State) - {State.FAULT, State.SAFE}))
def test_where_nothing_is_latched_there_is_nothing_to_reset(state):
    scene = Scene(state)
    assert scene.ask("reset")[0] == (f"the state is {state}; there is nothing to reset",)
    assert scene.record.reset_until_ns == 0


def test_a_reset_without_effect_is_told_once_when_its_time_is_over():
    scene = Scene(State.FAULT)
    assert scene.ask("reset") == (("",), frozenset())
    over = NOW + 2_000_000_000

    def judge(now):
        scene.supervisor.device.answered(Feedback(now, Phase.UP, "UP", faults=("bus",)))
        judge_reset(Patience(), scene.record, scene.supervisor, now)
        return scene.record.reset_failure

    told = "a reset had no effect for 2 s: the device reports bus"
    assert judge(over - 1) == ""
    assert scene.record.reset_until_ns == over
    assert judge(over) == told
    assert scene.record.reset_until_ns == 0
    assert list(scene.record.events) == [(over, told)]
    judge(over + 1)
    assert len(scene.record.events) == 1
    # a further one is tried afresh
    assert scene.ask("reset") == (("",), frozenset())
    assert scene.record.reset_failure == ""


def test_where_no_reset_was_asked_for_none_had_no_effect():
    scene = Scene(State.FAULT)
    judge_reset(Patience(), scene.record, scene.supervisor, NOW)
    assert not scene.record.events
    scene.record.reset_until_ns = 1
    judge_reset(Patience(), scene.record, scene.supervisor, NOW)
    assert scene.record.events
