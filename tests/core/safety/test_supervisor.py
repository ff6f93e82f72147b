"""From ages, answers and edges to the next state: each rule alone, exactly at its instant."""

import numpy as np
import pytest
from machines import compact
from own_kinematics import lengths

from motionserver.core.axes import frozen
from motionserver.core.device import Feedback, Phase
from motionserver.core.motion.moves import rest_to_rest
from motionserver.core.motion.player import Playback
from motionserver.core.safety.record import GuardRecord
from motionserver.core.safety.states import CUED, Event, State
from motionserver.core.safety.supervisor import Supervisor, is_standing
from motionserver.core.safety.verdict import AcceptedPlan
from motionserver.core.safety.watchdog import CueStatus, Patience
from motionserver.core.state import DriveMode

MS = 1_000_000
PERIOD = 1 / 64
"""Of packets and of plans [s]: twice and three times it are exact in binary."""
ZERO = frozen(np.zeros(6))
NEUTRAL = lengths(compact(), ZERO)[0]
MOVE = AcceptedPlan(rest_to_rest(2, 1, 0.0, ZERO, frozen([0.01] * 6), 1.0), None, 1.0)
MOVING, RESTING = Playback(MOVE, 0.999), Playback(MOVE, 1.0)


class Scene:
    """A second has passed in which device, source and planner did all that is expected."""

    def __init__(self, state=State.RUN, phase=Phase.UP, **config):
        self.supervisor = Supervisor(compact(), Patience(), PERIOD, PERIOD, **config)
        self.record = GuardRecord(state, deadline_ns=10**18)
        self.now = 0
        self.phase, self.answer = phase, {"legs": NEUTRAL}
        self.mode = DriveMode.DRIVE
        self.talks = self.sends = self.plans = True
        self.run(1000)

    def tick(self, ms=10, *wishes, ns=0):
        """What follows after so long a gap."""
        gap_ns = ms * MS + ns
        self.now += gap_ns
        if self.talks:
            answer = Feedback(self.now, self.phase, self.phase.name, **self.answer)
            self.supervisor.device.answered(answer)
        status = CueStatus(self.now, 150 * MS, self.mode) if self.sends else None
        self.supervisor.heard(self.now, status, gap_ns / 1e9)
        if self.plans:
            self.record.accepted_ns = self.now
        return self.supervisor.step(self.record, self.now, gap_ns / 1e9, frozenset(wishes))

    def run(self, ms):
        """Ticks of 10 ms; what follows from the last one."""
        found = None
        for _ in range(ms // 10):
            found = self.tick()
        return found

    def reset(self, ms=2000):
        self.record.reset_until_ns = self.now + ms * MS
        return self


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


# source and planner


def test_a_source_that_is_stale_holds():
    scene = Scene()
    scene.sends = False
    assert scene.run(150) is None
    assert scene.tick() == (State.HOLD, Event.TROUBLE)


def test_what_the_source_sent_may_be_read_after_a_gap_of_our_own_but_two_packets_are_none():
    for ms, ns, follows in (
        (31, 250_000, (State.HOLD, Event.TROUBLE)),
        (31, 250_001, None),
        (300, 0, None),
    ):
        scene = Scene()
        scene.sends = False
        scene.run(140)
        assert scene.tick(ms, ns=ns) == follows
    assert scene.run(150) is None
    assert scene.tick() == (State.HOLD, Event.TROUBLE)


def test_a_source_that_pauses_holds():
    scene = Scene()
    scene.mode = DriveMode.PAUSE
    assert scene.tick() == (State.HOLD, Event.TROUBLE)


def test_a_source_that_says_goodbye_parks_while_it_is_heard():
    scene = Scene(State.READY)
    scene.mode = DriveMode.BYE
    assert scene.tick() == (State.PARKING, Event.PARK)
    scene.sends = False
    assert scene.run(150) == (State.PARKING, Event.PARK)
    assert scene.tick() is None


def test_three_periods_without_a_plan_hold():
    scene = Scene()
    scene.plans = False
    assert scene.tick(23, ns=437_500) is None
    assert scene.tick(23, ns=437_500) is None
    assert scene.tick(0, ns=1) == (State.HOLD, Event.TROUBLE)


@pytest.mark.parametrize("state", [State.READY, State.HOLD])
def test_half_a_second_of_driving_runs_if_there_are_plans(state):
    scene = Scene(state)
    scene.record.since_ns = scene.now
    scene.mode = DriveMode.PAUSE
    scene.tick()
    scene.mode = DriveMode.DRIVE
    assert scene.run(500) is None
    assert scene.tick() == (State.RUN, Event.CUEING)
    scene.plans = False
    scene.run(40)
    assert scene.tick() is None


def test_after_a_gap_of_our_own_plans_are_waited_for_anew_once():
    scene = Scene()
    scene.plans = False
    assert scene.tick(200) is None
    assert scene.tick(40) is None
    assert scene.tick(7) == (State.HOLD, Event.TROUBLE), "the second gap was no excuse"
    scene.plans = True
    scene.tick()
    scene.plans = False
    assert scene.tick(200) is None, "a further plan came between"
    assert scene.run(40) is None
    assert scene.tick() == (State.HOLD, Event.TROUBLE)


def test_a_gap_before_the_first_plan_is_excused_as_any_other():
    scene = Scene()
    scene.plans, scene.record.accepted_ns = False, 0
    assert scene.tick() == (State.HOLD, Event.TROUBLE)
    assert scene.tick(40) is None


def test_a_plan_whose_clock_stood_still_is_waited_for_anew():
    scene = Scene()
    scene.plans = False
    scene.run(60)
    scene.supervisor.excuse_plans(scene.record.accepted_ns, scene.now)
    assert scene.run(40) is None
    assert scene.tick() == (State.HOLD, Event.TROUBLE)


def held(mode=DriveMode.DRIVE):
    """A hold that begins now."""
    scene = Scene(State.HOLD)
    scene.record.since_ns, scene.mode = scene.now, mode
    return scene


def test_a_hold_for_want_of_plans_lasts_two_seconds():
    scene = held()
    scene.plans = False
    assert scene.run(2000) is None
    assert scene.tick(0, ns=1) == (State.PARKING, Event.HOLD_EXPIRED)
    scene.record.state = State.READY
    assert scene.tick() is None, "only a hold expires"


def test_a_pause_lasts_ten_minutes():
    scene = held(DriveMode.PAUSE)
    scene.record.since_ns -= 599_000 * MS
    assert scene.run(1000) is None
    assert scene.tick(0, ns=1) == (State.PARKING, Event.HOLD_EXPIRED)


@pytest.mark.parametrize("lost", ["source", "planner"])
def test_a_pause_that_ends_without_a_drive_is_a_hold_from_then_on(lost):
    scene = held(DriveMode.PAUSE)
    scene.record.since_ns -= 300_000 * MS
    scene.run(100)
    if lost == "source":
        scene.sends = False
        scene.run(150)
    else:
        scene.plans = False
        scene.run(40)
    assert scene.run(2000) is None
    assert scene.tick() == (State.PARKING, Event.HOLD_EXPIRED)


def test_a_long_pause_that_ends_in_a_drive_runs():
    scene = held(DriveMode.PAUSE)
    scene.record.since_ns -= 599_800 * MS
    scene.tick()
    scene.mode = DriveMode.DRIVE
    assert scene.run(500) is None
    assert scene.tick() == (State.RUN, Event.CUEING)


def test_thirty_seconds_of_silence_park_where_the_platform_is_ready():
    scene = Scene(State.READY)
    scene.sends = False
    scene.run(160)
    assert scene.run(30_000) is None
    assert scene.tick(0, ns=1) == (State.PARKING, Event.SOURCE_SILENT)


def test_a_supervisor_that_takes_over_waits_for_answers_and_plans_anew():
    supervisor = Supervisor(compact(), Patience(), PERIOD, PERIOD)
    old, now = Feedback(1000 * MS, Phase.UP, "ENGAGED", NEUTRAL), 5000 * MS
    supervisor.resume(old, 900 * MS, now)
    record = GuardRecord(State.RUN, accepted_ns=900 * MS, deadline_ns=10**18)
    supervisor.heard(now, CueStatus(now, 150 * MS), 0.004)
    assert supervisor.step(record, now, 0.004, frozenset()) is None
    assert supervisor.device.newest is old
    later = now + 46_875_000
    assert supervisor.step(record, later, 0.004, frozenset()) is None
    assert supervisor.step(record, later + 1, 0.004, frozenset()) == (State.HOLD, Event.TROUBLE)
    lost = supervisor.step(record, now + 101 * MS, 0.004, frozenset())
    assert lost == (State.FAULT, Event.FEEDBACK_LOST)


def test_a_supervisor_that_takes_over_without_an_answer_has_none():
    supervisor = Supervisor(compact(), Patience(), PERIOD, PERIOD)
    supervisor.resume(None, 0, MS)
    assert supervisor.device.newest is None


# what is told


def test_what_happened_is_told_with_its_figures():
    scene = Scene()
    supervisor, now = scene.supervisor, scene.now
    supervisor.inconsistent = "no way home"
    assert supervisor.why(Event.INCONSISTENT, now) == "no way home"
    assert supervisor.why(Event.DEVICE_FAULT, now) == "the device reports UP"
    scene.answer["faults"] = ("bus", "drive 3")
    scene.tick()
    assert supervisor.why(Event.DEVICE_FAULT, now) == "the device reports bus, drive 3"
    lost = supervisor.why(Event.FEEDBACK_LOST, scene.now + 1234 * MS)
    assert lost == "no feedback from the device for 1234 ms"
    supervisor.device.error = 0.1234
    astray = supervisor.why(Event.TRACKING_ERROR, now)
    assert astray == "the platform does not follow: 123.4 mm off"
    assert supervisor.why(Event.PARK, now) == "park was asked for"


def test_why_it_holds_is_told():
    scene = Scene()
    why, now = scene.supervisor.why, scene.now
    assert why(Event.TROUBLE, now) == "no plan was accepted from the planner"
    assert why(Event.TROUBLE, now + 151 * MS) == (
        "the source is stale: nothing that can be believed comes from the simulator"
    )
    scene.mode = DriveMode.PAUSE
    scene.tick()
    assert why(Event.TROUBLE, scene.now) == "the simulator pauses"


def test_a_device_that_never_answered_has_reported_no_fault():
    supervisor = Supervisor(compact(), Patience(), PERIOD, PERIOD)
    assert supervisor.why(Event.DEVICE_FAULT, 0) == "the device reports a fault"


def test_why_engaging_is_not_possible_is_told():
    scene = Scene(State.PARKED, Phase.DOWN)
    refusal, record = scene.supervisor.refusal, scene.record
    assert refusal(record, scene.now) == ""
    assert refusal(record, scene.now + 151 * MS) == (
        "no fresh source that can be believed: start the simulator first"
    )
    record.state = State.RUN
    assert refusal(record, scene.now) == ("the state is RUN; engaging is possible in PARKED only")
    record.leaving = True
    assert refusal(record, scene.now) == "the service is ending"


def test_engaging_needs_a_device_that_says_it_is_down():
    needed = "the device does not say that it is down and ready"
    scene = Scene(State.PARKED, Phase.STARTING)
    assert scene.supervisor.refusal(scene.record, scene.now) == needed
    silent = Supervisor(compact(), Patience(), PERIOD, PERIOD)
    assert silent.refusal(GuardRecord(State.PARKED), 0) == needed


def test_standing_is_playing_nothing_or_being_at_rest():
    assert is_standing(None)
    assert is_standing(RESTING)
    assert not is_standing(MOVING)


def test_a_supervisor_begins_without_a_complaint():
    supervisor = Supervisor(compact(), Patience(), PERIOD, PERIOD)
    assert supervisor.inconsistent == ""
    assert supervisor.astray is False
    assert not supervisor.dry_run
