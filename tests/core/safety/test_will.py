"""What a guard leaves, as bytes and back, and bytes that no guard left."""

import json
from collections import Counter
from dataclasses import fields, replace

import numpy as np
import pytest
from machines import compact

from motionserver.core.axes import frozen
from motionserver.core.device import Feedback, Phase
from motionserver.core.motion.moves import rest_to_rest
from motionserver.core.motion.player import Playback
from motionserver.core.plan import rest_at
from motionserver.core.safety.accept import accept_rest
from motionserver.core.safety.record import GuardRecord
from motionserver.core.safety.states import State
from motionserver.core.safety.verdict import AcceptedPlan
from motionserver.core.safety.will import WillWriter, unpack_will, will_of

ZERO = frozen(np.zeros(6))
REST = rest_at(ZERO, 1)
FIRST, SECOND, THIRD = (
    rest_to_rest(number, number - 1, 0.25, ZERO, frozen([0.01 * number] * 6), 1.0)
    for number in (2, 3, 4)
)
ANSWER = Feedback(77, Phase.UP, "ENGAGED", frozen([1.0, 1.1, 1.2, 1.3, 1.4, 1.5]))


def record():
    """A guard that plays its second plan, while a third waits."""
    playing = Playback(AcceptedPlan(SECOND, FIRST, 2.0), 0.125, (AcceptedPlan(THIRD, SECOND, 2.0),))
    return GuardRecord(
        State.HOLD, "because", 11, playing, 22, 33, 44, True, True, 2**63 + 5, Counter(a=3)
    )


def through_bytes(will):
    return unpack_will(WillWriter().pack(will))


def same_plan(one, other):
    return all(
        np.array_equal(getattr(one, f.name), getattr(other, f.name)) for f in fields(one)[:7]
    )


def test_everything_a_successor_needs_comes_back():
    will = through_bytes(will_of(record(), ANSWER, 55, 66))
    assert (will.due_ns, will.taken_ns, will.since_ns, will.deadline_ns) == (66, 55, 11, 22)
    assert (will.reason, will.accepted_ns) == ("because", 33)
    assert will.state is State.HOLD
    assert will.leaving is will.engaged_once is True
    assert (will.next_id, will.clock, will.counters) == (2**63 + 5, 0.125, {"a": 3})
    assert same_plan(will.before, FIRST)
    assert [plan.plan_id for plan in will.plans] == [3, 4]
    assert all(map(same_plan, will.plans, (SECOND, THIRD)))
    assert will.feedback.arrival_ns == 77
    assert will.feedback.phase is Phase.UP
    assert will.feedback.legs.tolist() == [1.0, 1.1, 1.2, 1.3, 1.4, 1.5]


@pytest.mark.parametrize(
    "answer",
    [
        None,
        Feedback(5, Phase.FAULTED, "FAULT1", faults=("drive 3", "bus"), estop=True),
        Feedback(5, Phase.DOWN, "PARKED"),
    ],
)
def test_the_newest_answer_comes_back_as_it_was(answer):
    assert through_bytes(will_of(record(), answer, 0, 1)).feedback == answer


def test_a_measured_pose_comes_back():
    answer = Feedback(5, Phase.UP, "ENGAGED", pose=frozen([0.0, 0.1, 0.2, 0.3, 0.4, 0.5]))
    back = through_bytes(will_of(record(), answer, 0, 1)).feedback
    assert back.pose.tolist() == [0.0, 0.1, 0.2, 0.3, 0.4, 0.5]
    assert back.legs is None


def test_who_plays_nothing_leaves_no_plan_and_a_clock_at_its_beginning():
    will = through_bytes(will_of(GuardRecord(), None, 0, 1))
    assert (will.clock, will.before, will.plans) == (0.0, None, ())


def test_a_rest_has_nothing_before_it():
    resting = GuardRecord(playback=Playback(accept_rest(compact(), ZERO, 9, ZERO[None])))
    will = through_bytes(will_of(resting, None, 0, 1))
    assert will.before is None
    assert [plan.plan_id for plan in will.plans] == [9]


def test_a_plan_with_the_number_of_another_is_written_as_it_is():
    writer, will = WillWriter(), will_of(record(), None, 0, 1)
    assert writer.plan(REST) is writer.plan(REST)
    writer.pack(will)
    other = replace(THIRD, pose=frozen(THIRD.pose + 0.001))
    back = unpack_will(writer.pack(replace(will, plans=(SECOND, other))))
    assert same_plan(back.plans[1], other)


def test_a_plan_is_packed_once_while_it_is_left_and_forgotten_after():
    writer, will = WillWriter(), will_of(record(), None, 0, 1)
    writer.pack(will)
    packed = writer.plan(THIRD)
    writer.pack(will)
    assert writer.plan(THIRD) is packed
    writer.pack(replace(will, plans=(SECOND,)))
    assert writer.plan(THIRD) is not packed


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (b"5", "its head is 5"),
        (b"null", "its head is None"),
        (b"[" * 2000, "RecursionError"),
        ({"clock": float("nan")}, "clock is nan"),
        ({"clock": None}, "clock is None"),
        ({"next_id": 1 << 64}, "next_id is 18446744073709551616"),
        ({"due_ns": 1.5}, "due_ns is 1.5"),
        ({"leaving": 1}, "leaving is 1"),
        ({"counters": {"a": "b"}}, "counters is"),
        ({"counters": {"a": 1, "b": "c"}}, "counters is"),
        ({"counters": [1]}, "counters is"),
        ({"feedback": {"legs": [10**400] * 6}}, "too large"),
        ({"feedback": {"legs": [float("nan")] * 6}}, "not six numbers"),
        ({"feedback": {"legs": [1.0] * 5 + [float("nan")]}}, "not six numbers"),
        ({"feedback": {"legs": [1.0] * 5}}, "not six numbers"),
        ({"sent_legs": [1.0] * 5}, "sent_legs are not six numbers"),
        ({"feedback": {"legs": [1.0] * 5}}, "legs are not six numbers"),
        ({"feedback": {"estop": 0}}, "estop is 0"),
    ],
)
def test_what_no_guard_left_is_no_will(change, told):
    data = WillWriter().pack(will_of(record(), ANSWER, 0, 1))
    size = int.from_bytes(data[:4], "little")
    if isinstance(change, dict):
        head = json.loads(data[4 : 4 + size])
        more = change.get("feedback")
        head |= change if more is None else {"feedback": head["feedback"] | more}
        change = json.dumps(head).encode()
    with pytest.raises(ValueError, match=f"will of a guard: .*{told}"):
        unpack_will(len(change).to_bytes(4, "little") + change + data[4 + size :])
