"""From answers and edges to the next state: each rule alone, exactly at its instant."""

import pytest
from machines import compact
from supervisor_scene import MOVING, MS, NEUTRAL, PERIOD, RESTING, Scene

from motionserver.core.device import Phase
from motionserver.core.safety.record import GuardRecord
from motionserver.core.safety.states import CUED, Event, State
from motionserver.core.safety.supervisor import Supervisor
from motionserver.core.safety.watchdog import Patience


def test_where_all_is_well_every_state_stays():
    assert Scene(State.RUN).tick() is None
    assert Scene(State.PARKED, Phase.DOWN).tick() is None
    assert Scene(State.RAISING, Phase.RAISING).tick() is None
    parking = Scene(State.PARKING)
    parking.record.playback = MOVING
    assert parking.tick() is None


def test_of_several_events_the_worst_that_leads_away_wins():
    scene = Scene()
    scene.supervisor.astray = True
    assert scene.tick(10, Event.PARK) == (State.FAULT, Event.TRACKING_ERROR)
    scene.supervisor.inconsistent = "no way home"
    assert scene.tick() == (State.FAULT, Event.INCONSISTENT)
    scene.answer["estop"] = True
    assert scene.tick() == (State.SAFE, Event.ESTOP)


def test_an_edge_wishes_and_leaving_parks():
    assert Scene(State.PARKED, Phase.DOWN).tick(10, Event.ENGAGE) == (State.RAISING, Event.ENGAGE)
    scene = Scene()
    assert scene.tick(10, Event.PARK) == (State.PARKING, Event.PARK)
    scene.record.leaving = True
    assert scene.tick() == (State.PARKING, Event.PARK)


@pytest.mark.parametrize(
    ("state", "phase", "follows"),
    [
        (State.RAISING, Phase.RAISING, (State.PARKING, Event.RAISE_TIMEOUT)),
        (State.PARKING, Phase.LOWERING, (State.FAULT, Event.PARK_TIMEOUT)),
        (State.RUN, Phase.UP, None),
    ],
)
def test_raising_and_parking_may_last_to_their_deadline(state, phase, follows):
    scene = Scene(state, phase)
    scene.record.deadline_ns = scene.now + 10 * MS
    assert scene.tick() is None
    assert scene.tick(0, ns=1) == follows


def test_a_gap_of_our_own_moves_the_deadline():
    scene = Scene(State.RAISING, Phase.RAISING)
    scene.record.deadline_ns = 10**15
    scene.tick(31, ns=250_000)
    assert scene.record.deadline_ns == 10**15, "two packets are no gap"
    scene.tick(31, ns=250_001)
    assert scene.record.deadline_ns == 10**15 + 31_250_001


def test_a_gap_of_more_than_300_ms_holds():
    assert Scene().tick(300) is None
    assert Scene().tick(300, ns=1) == (State.HOLD, Event.LOOP_GAP)


# the device


@pytest.mark.parametrize("state", [State.RUN, State.RAISING, State.PARKING])
def test_a_device_that_is_silent_for_100_ms_is_lost(state):
    scene = Scene(state)
    scene.record.playback = MOVING
    scene.talks = False
    scene.run(90)
    scene.record.state = State.RUN if state is State.RAISING else state
    assert scene.tick() is None
    assert scene.tick(0, ns=1) == (State.FAULT, Event.FEEDBACK_LOST)


def test_a_device_that_never_answered_is_lost():
    supervisor = Supervisor(compact(), Patience(), PERIOD, PERIOD)
    found = supervisor.step(GuardRecord(State.PARKED), MS, 0.004, frozenset())
    assert found == (State.OFFLINE, Event.FEEDBACK_LOST)


def test_after_a_gap_of_our_own_answers_are_waited_for_anew():
    scene = Scene()
    scene.talks = False
    scene.tick(200)
    assert scene.run(100) is None
    assert scene.tick() == (State.FAULT, Event.FEEDBACK_LOST)


@pytest.mark.parametrize(
    "trouble", [{"faults": ("drive 3",)}, Phase.FAULTED, Phase.DISABLED], ids=str
)
@pytest.mark.parametrize("state", [State.OFFLINE, State.RAISING, State.RUN])
def test_a_device_that_reports_a_fault_is_one(state, trouble):
    scene = Scene(state)
    if isinstance(trouble, Phase):
        scene.phase = trouble
    else:
        scene.answer |= trouble
    assert scene.tick() == (State.FAULT, Event.DEVICE_FAULT)


@pytest.mark.parametrize("state", sorted(CUED))
def test_a_device_that_leaves_its_raised_phase_under_a_plan_is_a_fault_but_not_in_a_dry_run(state):
    scene = Scene(state)
    scene.plans = False
    scene.phase = Phase.LOWERING
    assert scene.tick() == (State.FAULT, Event.DEVICE_FAULT)
    dry = Scene(state, Phase.DOWN, dry_run=True)
    assert dry.tick() in (None, (State.RUN, Event.CUEING))


@pytest.mark.parametrize("phase", [Phase.LOWERING, Phase.DOWN])
def test_a_device_that_comes_down_while_parking_is_no_fault(phase):
    scene = Scene(State.PARKING, phase)
    scene.record.playback = MOVING
    assert scene.tick() is None


@pytest.mark.parametrize(
    ("phase", "follows"),
    [
        (Phase.DOWN, (State.PARKED, Event.DEVICE_DOWN)),
        (Phase.UP, (State.PARKING, Event.DEVICE_UP)),
        (Phase.STARTING, None),
    ],
)
def test_a_device_is_believed_after_300_ms(phase, follows):
    scene = Scene(State.OFFLINE, phase)
    scene.talks = False
    scene.run(200)
    scene.talks = True
    assert scene.run(300) is None
    assert scene.tick() == follows


def test_a_device_that_is_found_raised_must_stand_still_first():
    scene = Scene(State.OFFLINE)
    scene.answer["legs"] = NEUTRAL + 0.01
    assert scene.run(300) is None
    assert scene.tick() == (State.PARKING, Event.DEVICE_UP)


def test_parking_ends_when_the_device_is_down_and_the_plan_at_rest():
    scene = Scene(State.PARKING, Phase.DOWN)
    for playback, follows in (
        (MOVING, None),
        (RESTING, (State.PARKED, Event.DEVICE_DOWN)),
        (None, (State.PARKED, Event.DEVICE_DOWN)),
    ):
        scene.record.playback = playback
        assert scene.tick() == follows


def test_neutral_is_reached_when_the_device_says_so_moving_or_not():
    scene = Scene(State.RAISING)
    scene.answer["legs"] = NEUTRAL + 0.01
    assert scene.tick() == (State.READY, Event.RAISED)
    for phase in (Phase.RAISING, Phase.DOWN):
        assert Scene(State.RAISING, phase).tick() is None
    assert Scene(State.RAISING, Phase.DOWN, dry_run=True).tick() == (State.READY, Event.RAISED)


# resets


@pytest.mark.parametrize("state", [State.FAULT, State.SAFE])
@pytest.mark.parametrize(
    ("phase", "follows"),
    [
        (Phase.DOWN, (State.PARKED, Event.RESET_DOWN)),
        (Phase.UP, (State.PARKING, Event.RESET_UP)),
        (Phase.LOWERING, None),
        (Phase.FAULTED, None),
    ],
)
def test_a_reset_leads_to_where_the_device_is(state, phase, follows):
    assert Scene(state, phase).reset().tick() == follows
    assert Scene(state, phase).tick() is None, "nobody asked"


@pytest.mark.parametrize("phase", [Phase.DOWN, Phase.UP])
def test_a_reset_is_tried_up_to_its_end_and_only_when_nothing_moves(phase):
    scene = Scene(State.FAULT, phase).reset(10)
    assert scene.tick() is None
    scene = Scene(State.FAULT, phase).reset()
    scene.record.playback = MOVING
    assert scene.tick() is None
    scene.record.playback = RESTING
    assert scene.tick() is not None


def test_a_reset_waits_until_a_raised_device_stands():
    scene = Scene(State.FAULT).reset()
    scene.answer["legs"] = NEUTRAL + 0.01
    assert scene.run(300) is None
    assert scene.tick() == (State.PARKING, Event.RESET_UP)


@pytest.mark.parametrize("trouble", [{"faults": ("bus",)}, {"estop": True}], ids=str)
@pytest.mark.parametrize("phase", [Phase.DOWN, Phase.UP])
def test_no_reset_leads_past_what_is_still_there(trouble, phase):
    scene = Scene(State.SAFE, phase).reset()
    scene.answer |= trouble
    assert scene.tick() is None


def test_a_reset_waits_until_the_device_is_believed():
    scene = Scene(State.FAULT, Phase.DOWN)
    scene.talks = False
    scene.run(200)
    scene.talks = True
    scene.tick()
    assert scene.reset().tick() is None
    scene.run(280)
    assert scene.tick() == (State.PARKED, Event.RESET_DOWN)


def test_a_reset_of_a_silent_device_begins_at_the_beginning():
    scene = Scene(State.FAULT)
    scene.talks = False
    scene.run(200)
    assert scene.tick() is None
    scene.reset(10)
    assert scene.tick() is None, "it was tried for long enough"
    scene.reset().record.playback = MOVING
    assert scene.tick() is None
    scene.record.playback = RESTING
    assert scene.tick() == (State.OFFLINE, Event.RESET_BLIND)
