"""What the network refused, and what became of a proposal."""

import pytest
from act_scene import LIFTED, MS, PERIOD, SECOND, ZERO, Scene, at_rest, moving

from motionserver.core.device import Phase
from motionserver.core.motion.moves import rest_to_rest
from motionserver.core.safety import act
from motionserver.core.safety.states import State
from motionserver.core.safety.verdict import Reason

# what the network refused


def test_a_sample_that_did_not_go_out_is_the_next_one():
    scene = Scene(State.RUN, playback=moving())
    first = scene.tick()
    scene.guard.told(scene.now, False)
    assert scene.record.playback.clock == 0.5
    again = scene.tick()
    scene.guard.told(scene.now, True)
    assert again.state.pose.tolist() == first.state.pose.tolist()
    assert scene.tick().state.pose[2] > first.state.pose[2]


def test_a_sample_that_a_guard_before_owed_is_owed_until_it_goes_out():
    scene = Scene(State.RUN, playback=moving())
    scene.guard.owes_sample = True
    first = scene.tick()
    assert not scene.guard.owes_sample
    assert scene.record.playback.clock == 0.5
    scene.guard.told(scene.now, False)
    assert scene.guard.owes_sample
    assert scene.tick().state.pose.tolist() == first.state.pose.tolist()
    scene.guard.told(scene.now, True)
    scene.tick()
    assert scene.record.playback.clock == 0.5 + PERIOD


@pytest.mark.parametrize("state", sorted(act.RAISED))
def test_a_network_that_refuses_for_more_than_100_ms_is_a_fault_while_raised(state):
    scene = Scene(state, playback=moving())
    scene.tick()
    begin = scene.now
    scene.guard.told(begin, False)
    scene.guard.told(begin + 100 * MS, False)
    assert scene.guard.supervisor.inconsistent == ""
    scene.guard.told(begin + 100 * MS + 1, False)
    assert scene.guard.supervisor.inconsistent != ""
    scene.guard.told(begin + 1234 * MS, False)
    assert scene.guard.supervisor.inconsistent == (
        "the network takes no setpoint for 1234 ms: see to the way to the platform"
    )


def test_a_network_that_refuses_before_anything_was_played_takes_nothing_away():
    scene = Scene()
    scene.guard.told(scene.now, False)
    assert scene.record.playback is None
    assert not scene.guard.owes_sample


def test_one_setpoint_that_goes_out_ends_what_the_network_refused():
    scene = Scene(State.RUN, playback=moving())
    scene.tick()
    scene.guard.told(scene.now, False)
    scene.guard.told(scene.now + 50 * MS, True)
    scene.guard.told(scene.now + 101 * MS, False)
    assert scene.guard.supervisor.inconsistent == ""


def test_a_network_that_refuses_while_parked_is_no_fault():
    scene = Scene(State.PARKED, Phase.DOWN)
    scene.tick()
    scene.guard.told(scene.now, False)
    scene.guard.told(scene.now + 5 * SECOND, False)
    assert scene.guard.supervisor.inconsistent == ""


def test_after_a_second_unheard_the_plan_of_a_fault_is_given_up():
    scene = Scene(State.FAULT, playback=moving())
    scene.tick()
    scene.guard.told(scene.now, False)
    scene.guard.told(scene.now + SECOND, False)
    assert scene.record.playback is not None
    scene.guard.told(scene.now + SECOND + 1, False)
    assert scene.record.playback is None
    running = Scene(State.RUN, playback=moving())
    running.tick()
    running.guard.told(running.now, False)
    running.guard.told(running.now + 2 * SECOND, False)
    assert running.record.playback is not None


def test_plans_are_waited_for_anew_after_what_the_network_refused():
    scene = Scene(State.RUN, playback=at_rest())
    scene.tick()
    scene.drives = False
    for _ in range(20):
        scene.tick()
        scene.guard.told(scene.now, False)
    assert scene.record.state is State.RUN
    for _ in range(12):
        scene.tick()
        scene.guard.told(scene.now, True)
    assert scene.record.state is State.HOLD


# proposals


def test_an_accepted_proposal_follows_and_is_counted_with_its_instant():
    scene = Scene(State.RUN, playback=at_rest())
    scene.drives = False
    plan = rest_to_rest(7, 1, 0.1, ZERO, LIFTED, 2.0)
    scene.tick(proposal=plan)
    assert scene.guard.judged is plan
    assert scene.record.playback.newest.plan is plan
    assert scene.record.accepted_ns == scene.now
    assert scene.record.counters["plans_accepted"] == 1
    assert scene.record.counters["plans_rejected"] == 0
    assert (scene.record.judged_id, scene.record.refusal) == (plan.plan_id, None)
    scene.tick()
    assert scene.guard.judged is None


def test_a_rejected_proposal_is_counted_and_kept_with_its_reason():
    scene = Scene(State.RUN, playback=at_rest())
    before = scene.record.accepted_ns
    scene.drives = False
    plan = rest_to_rest(7, 5, 0.1, ZERO, LIFTED, 2.0)
    scene.tick(proposal=plan)
    assert scene.guard.judged is plan
    assert scene.record.accepted_ns == before
    assert scene.record.counters["plans_accepted"] == 0
    assert scene.record.counters["plans_rejected"] == 1
    assert scene.record.counters["rejected_wrong-parent"] == 1
    assert (scene.record.judged_id, scene.record.refusal) == (7, Reason.WRONG_PARENT)
    (when, why) = scene.record.rejections[-1]
    assert (when, why.reason) == (scene.now, Reason.WRONG_PARENT)


@pytest.mark.parametrize(
    ("state", "playback"), [(State.PARKED, None), (State.PARKED, at_rest()), (State.RUN, None)]
)
def test_where_nothing_is_cued_no_proposal_is_taken(state, playback):
    scene = Scene(state, Phase.DOWN if state is State.PARKED else Phase.UP, playback)
    scene.tick(proposal=rest_to_rest(7, 1, 0.1, ZERO, LIFTED, 2.0))
    assert scene.record.counters["rejected_not-cueing"] == 1


def test_a_proposal_that_overtakes_one_that_waits_is_counted():
    scene = Scene(State.RUN, playback=at_rest(), slices=1)
    first, second, third = (rest_to_rest(number, 1, 0.3, ZERO, LIFTED, 2.0) for number in (7, 8, 9))
    scene.tick(proposal=first)
    assert scene.guard.is_checking
    assert scene.guard.judged is None
    scene.tick(proposal=second)
    scene.tick()
    assert scene.record.counters["plans_overtaken"] == 0
    scene.tick(proposal=third)
    assert scene.record.counters["plans_overtaken"] == 1
    while scene.guard.is_checking:
        scene.tick()
        if scene.guard.judged is not None:
            break
    assert scene.guard.judged is first
    assert scene.record.counters["plans_accepted"] == 1
