"""The guard's record at its start, what it keeps for people, and what is told when nothing is."""

from machines import compact

from motionserver.core.safety.given import GuardConfig, Request, TickInput
from motionserver.core.safety.record import GuardRecord
from motionserver.core.safety.states import State
from motionserver.core.safety.verdict import Reason, Rejection


def test_a_new_guard_knows_nothing_and_has_promised_nothing():
    record = GuardRecord()
    assert record.state is State.OFFLINE
    assert record.playback is None
    instants = (record.since_ns, record.deadline_ns, record.accepted_ns, record.reset_until_ns)
    assert instants == (0, 0, 0, 0)
    assert not record.leaving
    assert not record.engaged_once
    assert not record.counters
    assert not record.events
    assert not record.rejections
    assert (record.judged_id, record.refusal) == (0, None)
    assert record.sent_legs is None
    assert record.reset_failure == ""


def test_the_guards_own_plans_have_the_upper_half_of_the_numbers_to_themselves():
    record = GuardRecord()
    assert [record.take_id() for _ in range(3)] == [2**63 + 1, 2**63 + 2, 2**63 + 3]


def test_the_newest_forty_events_and_twenty_rejections_are_kept():
    record = GuardRecord()
    for k in range(50):
        record.note(k, f"event {k}")
        record.rejections.append((k, Rejection(Reason.TOO_LATE)))
    assert [at for at, _ in record.events] == list(range(10, 50))
    assert record.events[-1] == (49, "event 49")
    assert [at for at, _ in record.rejections] == list(range(30, 50))


def test_what_is_meant_when_nothing_is_said():
    config = GuardConfig(compact(), 1 / 60, 0.01)
    assert config.engage == "console"
    assert not config.dry_run
    assert config.slices == 0
    assert Request("engage", "http").enabled
    given = TickInput(1, 0.0, is_due=True)
    assert not given.leave
    assert given.cue is given.proposal is None
    assert given.feedback == given.requests == ()
