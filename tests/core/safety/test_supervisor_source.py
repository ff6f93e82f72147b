"""Source and planner, holds and pauses exactly at their instants, and what people are told."""

from functools import partial

import pytest
from machines import compact
from supervisor_scene import MOVING, MS, NEUTRAL, PERIOD, RESTING, Scene

from motionserver.core.device import Feedback, Phase
from motionserver.core.safety.record import GuardRecord
from motionserver.core.safety.source_reason import source_reason
from motionserver.core.safety.states import Event, State
from motionserver.core.safety.supervisor import Supervisor, is_standing, no_plan_reason
from motionserver.core.safety.verdict import Reason, Rejection
from motionserver.core.safety.watchdog import CueStatus, Patience
from motionserver.core.state import DriveMode


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
    assert supervisor.why(scene.record, Event.INCONSISTENT, now) == "no way home"
    assert supervisor.why(scene.record, Event.DEVICE_FAULT, now) == "the device reports UP"
    scene.answer["faults"] = ("bus", "drive 3")
    scene.tick()
    assert (
        supervisor.why(scene.record, Event.DEVICE_FAULT, now) == "the device reports bus, drive 3"
    )
    lost = supervisor.why(scene.record, Event.FEEDBACK_LOST, scene.now + 1234 * MS)
    assert lost == "no feedback from the device for 1234 ms"
    supervisor.device.error = 0.1234
    astray = supervisor.why(scene.record, Event.TRACKING_ERROR, now)
    assert astray == "the platform does not follow: 123.4 mm off"
    assert supervisor.why(scene.record, Event.PARK, now) == "park was asked for"


def test_why_it_holds_is_told():
    scene = Scene()
    why, now = partial(scene.supervisor.why, scene.record), scene.now
    assert why(Event.TROUBLE, now) == "no plan came from the planner"
    assert why(Event.TROUBLE, now + 151 * MS) == (
        "the source is stale: the planner has not reported for 151 ms; the simulator was heard by "
        "it until then"
    )
    scene.mode = DriveMode.PAUSE
    scene.tick()
    assert why(Event.TROUBLE, scene.now) == "the simulator pauses"


def test_the_newest_rejection_since_the_last_accepted_plan_is_told():
    scene = Scene()
    why, now, record = scene.supervisor.why, scene.now, scene.record
    record.rejections.append((record.accepted_ns, Rejection(Reason.TOO_LATE)))
    assert why(record, Event.TROUBLE, now) == "no plan came from the planner"
    record.rejections.append(
        (record.accepted_ns + 1, Rejection(Reason.LEG_SPEED, 0.5, 2, 0.7, 0.6))
    )
    assert why(record, Event.TROUBLE, now) == (
        "no plan was accepted from the planner; the newest: plan rejected: leg-speed, leg 3, at "
        "0.500 s, found 0.7, allowed 0.6"
    )


@pytest.mark.parametrize(
    ("phase", "answer", "told"),
    [
        (Phase.UP, {"estop": True, "faults": ("bus",)}, "the emergency stop is open"),
        (Phase.UP, {"faults": ("bus", "drive 3")}, "the device reports bus, drive 3"),
        (Phase.FAULTED, {}, "the device reports FAULTED"),
        (Phase.UP, {}, "the device's answers came with breaks, or the platform moved"),
        (Phase.DOWN, {}, "the device's answers came with breaks, or the platform moved"),
        (Phase.LOWERING, {}, "the device says LOWERING, neither up nor down"),
    ],
)
def test_what_keeps_a_reset_from_its_effect_is_told(phase, answer, told):
    scene = Scene()
    scene.phase = phase
    scene.answer.update(answer)
    scene.tick()
    assert scene.supervisor.why_not_reset(scene.now) == told


def test_a_reset_of_a_device_that_went_silent_is_told():
    scene = Scene()
    assert scene.supervisor.why_not_reset(scene.now + 101 * MS) == "the device does not answer"


def test_a_device_that_never_answered_has_reported_no_fault():
    supervisor = Supervisor(compact(), Patience(), PERIOD, PERIOD)
    assert supervisor.why(GuardRecord(), Event.DEVICE_FAULT, 0) == "the device reports a fault"


def test_why_engaging_is_not_possible_is_told():
    scene = Scene(State.PARKED, Phase.DOWN)
    refusal, record = scene.supervisor.refusal, scene.record
    assert refusal(record, scene.now) == ""
    assert refusal(record, scene.now + 151 * MS) == (
        "no fresh source: the planner has not reported for 151 ms; the simulator was heard by it "
        "until then"
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
    assert supervisor.return_decision.status == ""


@pytest.mark.parametrize(
    ("status", "said"),
    [
        (CueStatus(), "the planner has not reported yet: it is starting, or its process has ended"),
        (
            CueStatus(looked_ns=8_800 * MS),
            "the planner has not reported for 1.2 s; it had heard no simulator",
        ),
        (
            CueStatus(8_780 * MS, 150 * MS, heard_ns=8_780 * MS, looked_ns=8_800 * MS),
            "the planner has not reported for 1.2 s; the simulator was heard by it until then",
        ),
        (
            CueStatus(9_800 * MS, 150 * MS, heard_ns=9_800 * MS, looked_ns=9_990 * MS),
            "the simulator's newest packet is 200 ms old",
        ),
        (
            CueStatus(looked_ns=9_990 * MS),
            "no packet of a simulator has arrived: start the simulator first",
        ),
        # 50 ms is no delay of the planner, and a nanosecond more is one
        (
            CueStatus(looked_ns=9_950 * MS),
            "no packet of a simulator has arrived: start the simulator first",
        ),
        (
            CueStatus(looked_ns=9_950 * MS - 1),
            "the planner has not reported for 50 ms; it had heard no simulator",
        ),
        # the side is named to which the larger share of the age belongs
        (
            CueStatus(heard_ns=9_840 * MS, looked_ns=9_940 * MS),
            "the simulator's newest packet is 160 ms old",
        ),
        (
            CueStatus(heard_ns=9_880 * MS, looked_ns=9_940 * MS),
            "the simulator's newest packet is 120 ms old",
        ),
        (
            CueStatus(heard_ns=9_880 * MS + 1, looked_ns=9_940 * MS),
            "the planner has not reported for 60 ms; the simulator was heard by it until then",
        ),
        (
            CueStatus(heard_ns=9_000 * MS, looked_ns=9_999 * MS),
            "the simulator's newest packet is 1.0 s old",
        ),
        (
            CueStatus(heard_ns=10_000 * MS - 900_500_400, looked_ns=9_999 * MS),
            "the simulator's newest packet is 901 ms old",
        ),
        (CueStatus(0, 0, heard_ns=9_985 * MS, trouble="in g", looked_ns=9_990 * MS), "in g"),
    ],
)
def test_the_side_that_is_late_is_named_with_its_age(status, said):
    assert source_reason(status, 10_000 * MS) == said


def outage(seconds, pattern=None):
    """A drive whose source is silent for so long, then as ``pattern`` says [ms on, ms off]."""
    scene = Scene()
    states, begun = [], scene.now

    def let(ms, sends):
        scene.sends = sends
        for _ in range(ms // 10):
            followed = scene.tick()
            if followed is not None:
                scene.record.state, scene.record.since_ns = followed[0], scene.now
                states.append((followed[0], (scene.now - begun) / 1e9))

    let(round(seconds * 1000), False)
    for _ in range(200 if pattern else 1):
        on, off = pattern or (3000, 0)
        let(on, True)
        let(off, False)
        if states[-1][0] is State.PARKING:
            break
    return states


@pytest.mark.parametrize("seconds", [0.2, 1.6, 2.1])
def test_an_outage_that_is_over_before_the_hold_has_run_out_does_not_park(seconds):
    assert [state for state, _ in outage(seconds)] == [State.HOLD, State.RUN]


def test_every_hold_has_its_own_patience():
    """What an earlier outage was spared is not added to a later one."""
    (_, _), (_, _), (hold, held), (end, ended) = outage(1.0, (5000, 4000))
    assert (hold, end) == (State.HOLD, State.PARKING)
    assert ended - held == pytest.approx(2.0, abs=0.03)


def test_a_hold_is_spared_the_time_in_which_only_the_source_is_waited_for():
    """After a pause plans are missing, come for 300 ms, too short for a drive, and go again."""
    scene = held(DriveMode.PAUSE)
    scene.run(1000)
    scene.mode = DriveMode.DRIVE
    for plans, ms in ((False, 60), (True, 300), (False, 1940)):
        scene.plans = plans
        assert scene.run(ms) is None
    # 2.3 s of which at least 300 ms were spared, and at most 350
    assert scene.run(60) == (State.PARKING, Event.HOLD_EXPIRED)


def test_an_outage_that_is_longer_than_a_hold_parks():
    (_, held), (state, parked) = outage(2.5)
    assert state is State.PARKING
    assert parked - held == pytest.approx(2.0, abs=0.02)


@pytest.mark.parametrize(("pattern", "most"), [((100, 400), 4.5), ((300, 200), 10.1)])
def test_a_source_that_comes_and_goes_parks_in_the_end(pattern, most):
    (_, held), (state, parked) = outage(0.2, pattern)
    assert state is State.PARKING
    assert 2.0 < parked - held <= most


def test_of_many_plans_that_were_refused_the_newest_is_told():
    record = GuardRecord(accepted_ns=5)
    for at, why in ((6, Reason.TOO_LATE), (7, Reason.LEG_JERK), (8, Reason.WRONG_PARENT)):
        record.rejections.append((at, Rejection(why)))
    assert str(Rejection(Reason.WRONG_PARENT)) in no_plan_reason(record)
    record.accepted_ns = 8
    assert no_plan_reason(record) == "no plan came from the planner"
