"""How a platform that stands in a fault comes down: what is decided and told, look by look."""

from typing import Any

import numpy as np
import pytest
from act_scene import NEUTRAL, ZERO
from machines import compact

from motionserver.core.device import Feedback, Phase
from motionserver.core.safety.return_decision import ReturnDecision, Step
from motionserver.core.safety.watchdog import DeviceWatch, Patience

MS = 1_000_000
SECOND = 1_000_000_000
NEWS = 500 * MS
"""Shortest time between two events about the same fault [ns]."""
PATIENT = "it is brought home and parked once the device has answered without fault for 1 s"
SILENT = (
    "the device does not answer; once it has answered without fault for 1 s it is brought home and "
    "parked"
)


class Looks:
    """A device that answers, and a decision every 50 ms."""

    def __init__(self) -> None:
        self.device = DeviceWatch(compact(), Patience(), 1 / 60)
        self.decision = ReturnDecision(Patience(), self.device)
        self.now = 0
        self.told: dict[str, Any] = {"legs": NEUTRAL}
        self.sent: Any = NEUTRAL
        self.is_played, self.is_neutral = True, False

    def look(self, ns: int = 50 * MS, phase: Phase | None = Phase.UP, **told: Any) -> Step:
        """Pass ``ns``; the device answers now if it has a phase; decide."""
        self.now += ns
        if phase is not None:
            answer = Feedback(self.now, phase, phase.name, **(self.told | told))
            self.device.answered(answer)
        return self.decide()

    def decide(self) -> Step:
        return self.decision.decide(self.sent, self.is_played, self.is_neutral, self.now)

    def looks(self, count: int, phase: Phase | None = Phase.UP, **told: Any) -> list[Step]:
        return [self.look(50 * MS, phase, **told) for _ in range(count)]

    def waits(self, phase: Phase = Phase.UP, **told: Any) -> Step:
        """Nothing is done for a second since the first look; what is done after it."""
        assert self.looks(20, phase, **told) == [Step.WAIT] * 20
        return self.look(50 * MS, phase, **told)


@pytest.fixture
def looks() -> Looks:
    return Looks()


@pytest.mark.parametrize(
    ("is_neutral", "step", "told"),
    [
        (False, Step.HOME, "it is on its way home"),
        (True, Step.PARK, "it is being parked"),
    ],
)
def test_after_a_second_it_is_brought_down(looks, is_neutral, step, told) -> None:
    looks.is_neutral = is_neutral
    assert looks.look() is Step.WAIT
    assert (looks.decision.status, looks.decision.is_blocked) == (PATIENT, False)
    assert looks.looks(19) == [Step.WAIT] * 19
    assert looks.look(50 * MS - 1) is Step.WAIT
    assert looks.look(1) is step
    assert (looks.decision.status, looks.decision.is_blocked) == (told, False)


def test_a_second_counts_from_the_first_look_not_from_the_first_answer(looks) -> None:
    for _ in range(40):
        looks.now += 50 * MS
        looks.device.answered(Feedback(looks.now, Phase.UP, "UP", **looks.told))
    assert looks.decide() is Step.WAIT
    assert looks.looks(19) == [Step.WAIT] * 19
    assert looks.look() is Step.HOME


@pytest.mark.parametrize("faulty", [{"faults": ("bus",)}, {"estop": True}])
def test_a_second_counts_from_the_last_fault(looks, faulty) -> None:
    """An answer with a fault that was not looked at, and those after it."""
    looks.looks(10)
    looks.device.answered(Feedback(looks.now + 1, Phase.UP, "UP", NEUTRAL, **faulty))
    assert looks.waits() is Step.HOME


def test_a_fault_that_is_looked_at_begins_the_second_with_the_next_look(looks) -> None:
    looks.looks(10)
    looks.look(faults=("bus",))
    # its end is answered before it is looked at
    looks.device.answered(Feedback(looks.now + 1, Phase.UP, "UP", NEUTRAL))
    waits_from_the_next_look(looks)


def test_silence_that_is_looked_at_begins_the_second_with_the_next_look(looks) -> None:
    looks.looks(10)
    looks.looks(3, None)
    looks.device.answered(Feedback(looks.now + 1, Phase.UP, "UP", NEUTRAL))
    waits_from_the_next_look(looks)


def waits_from_the_next_look(looks: Looks) -> None:
    assert looks.looks(20) == [Step.WAIT] * 20
    # 999 ms after the first of these looks, 1049 ms after the answer before it
    assert looks.look(49 * MS) is Step.WAIT
    assert looks.look(1 * MS) is Step.HOME


@pytest.mark.parametrize(("gap", "begins_anew"), [(300 * MS, False), (300 * MS + 1, True)])
def test_who_did_not_look_for_a_while_begins_anew(looks, gap, begins_anew) -> None:
    """A plan was played meanwhile, or the guard itself stood still; the device answered."""
    looks.looks(10)
    for k in range(1, 5):
        looks.device.answered(Feedback(looks.now + k * 60 * MS, Phase.UP, "UP", NEUTRAL))
    looks.look(gap)
    steps = looks.looks(20)
    done = steps.index(Step.HOME)
    assert done == (19 if begins_anew else 4)


def test_another_state_begins_anew(looks) -> None:
    looks.looks(19)
    looks.decision.enter()
    assert (looks.decision.status, looks.decision.is_blocked) == ("", False)
    assert looks.waits() is Step.HOME


def test_who_says_another_phase_begins_anew(looks) -> None:
    looks.looks(19)
    assert looks.waits(Phase.LOWERING) is Step.PARK


@pytest.mark.parametrize("phase", [Phase.RAISING, Phase.LOWERING])
def test_a_device_that_moves_by_itself_is_parked_wherever_it_is(looks, phase) -> None:
    looks.sent = NEUTRAL + 0.2
    looks.is_played = False
    assert looks.waits(phase) is Step.PARK
    assert looks.decision.status == "it is being parked"
    assert looks.looks(10, phase) == [Step.PARK] * 10


def test_what_is_being_parked_is_parked_though_it_stands_elsewhere(looks) -> None:
    looks.is_neutral = True
    assert looks.waits() is Step.PARK
    looks.is_neutral, looks.sent = False, NEUTRAL + 0.2
    assert looks.decide() is Step.PARK
    assert looks.looks(5) == [Step.PARK] * 5
    # it says another phase: it goes on
    assert looks.looks(5, Phase.LOWERING) == [Step.PARK] * 5


@pytest.mark.parametrize("told", [{"faults": ("bus",)}, {"estop": True}])
def test_parking_begins_anew_after_a_fault(looks, told) -> None:
    looks.is_neutral = True
    assert looks.waits() is Step.PARK
    looks.device.answered(Feedback(looks.now + 1, Phase.UP, "UP", NEUTRAL, **told))
    assert looks.look() is Step.WAIT


def test_parking_is_forgotten_with_a_break(looks) -> None:
    looks.is_neutral = True
    assert looks.waits() is Step.PARK
    looks.look(150 * MS, None)
    looks.is_neutral = False
    assert looks.waits() is Step.HOME, "it stands where it was sent"


def test_parking_is_forgotten_with_another_state(looks) -> None:
    looks.is_neutral = True
    assert looks.waits() is Step.PARK
    looks.decision.enter()
    assert looks.look() is Step.WAIT


def test_a_device_that_is_sound_for_long_is_not_parked_without_a_wait(looks) -> None:
    looks.is_neutral = True
    for _ in range(40):
        looks.now += 50 * MS
        looks.device.answered(Feedback(looks.now, Phase.UP, "UP", **looks.told))
    assert looks.decide() is Step.WAIT


@pytest.mark.parametrize(
    ("told", "phase", "words"),
    [
        ({"faults": ("bus", "drive 3")}, Phase.UP, "reports bus, drive 3"),
        ({"faults": ("bus",)}, Phase.DOWN, "reports bus"),
        ({}, Phase.FAULTED, "reports FAULTED"),
        ({}, Phase.DISABLED, "reports DISABLED"),
    ],
)
def test_a_faulty_device_is_told_to_park_at_once(looks, told, phase, words) -> None:
    assert looks.look(phase=phase, **told) is Step.PARK
    assert looks.decision.status == f"the device is told to park as long as it {words}"
    assert not looks.decision.is_blocked
    looks.look(150 * MS, None)
    assert looks.decision.status.endswith(words), "whatever it reported last, silent or not"


def test_a_silent_device_is_waited_for(looks) -> None:
    assert looks.look(phase=None) is Step.WAIT
    assert (looks.decision.status, looks.decision.is_blocked) == (SILENT, True)
    looks.look()
    assert looks.decision.status == PATIENT
    assert looks.look(100 * MS, None) is Step.WAIT
    assert looks.decision.status == PATIENT
    assert looks.look(1, None) is Step.WAIT
    assert (looks.decision.status, looks.decision.is_blocked) == (SILENT, True)


def test_a_device_that_is_down_is_down(looks) -> None:
    assert looks.look(phase=Phase.DOWN) is Step.DOWN
    assert looks.decision.status == "it is down; a reset makes it ready again"
    assert not looks.decision.is_blocked


def test_a_device_that_starts_is_waited_for(looks) -> None:
    looks.looks(15)
    assert looks.looks(40, Phase.STARTING) == [Step.WAIT] * 40
    assert looks.decision.status == "the device says STARTING; it is waited for"
    assert looks.decision.is_blocked
    assert looks.waits() is Step.HOME


@pytest.mark.parametrize("leg", range(6))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_platform_that_stands_elsewhere_is_not_moved(looks, leg, sign) -> None:
    looks.looks(19)
    off = np.zeros(6)
    off[leg] = sign * 0.0101
    assert looks.looks(40, legs=NEUTRAL + off) == [Step.WAIT] * 40
    assert looks.decision.is_blocked
    assert looks.decision.status == (
        "the platform stands 10 mm from where it was sent: free it, or reset to bring it home from "
        "where it is measured"
    )
    assert looks.waits(legs=NEUTRAL + off / 1.02) is Step.HOME


def test_ten_millimetres_are_borne(looks) -> None:
    looks.sent = np.zeros(6)
    assert looks.waits(legs=np.full(6, 0.010)) is Step.HOME
    looks.look(legs=np.full(6, np.nextafter(0.010, 1.0)))
    assert "10 mm from where" in looks.decision.status
    looks.look(legs=np.array([0.0, 0.0, -1.234, 0.0, 0.0, 0.0]))
    assert "stands 1234 mm from" in looks.decision.status


def test_where_nothing_is_measured_it_is_assumed_where_it_was_sent(looks) -> None:
    looks.told = {}
    assert looks.waits() is Step.HOME
    assert looks.decision.status == (
        "it is on its way home; it is not measured, and assumed where sent"
    )


def test_a_measured_pose_is_as_good_as_legs(looks) -> None:
    looks.told = {"pose": ZERO}
    assert looks.waits() is Step.HOME
    assert looks.decision.status == "it is on its way home"


def test_where_it_was_never_sent_it_is_not_elsewhere(looks) -> None:
    looks.sent, looks.is_played = None, False
    # 300 ms must pass until it counts as standing, then the second
    assert looks.looks(6, legs=NEUTRAL + 0.1) == [Step.WAIT] * 6
    assert looks.waits(legs=NEUTRAL + 0.1) is Step.BEGIN
    assert looks.decision.status == "it is on its way home"


def test_what_moves_is_waited_for_where_nothing_was_played(looks) -> None:
    looks.sent, looks.is_played = None, False
    for k in range(60):
        assert looks.look(legs=NEUTRAL + 0.003 * (k % 2)) is Step.WAIT
        assert looks.decision.status == PATIENT
    assert looks.looks(40).index(Step.BEGIN) == 26
    looks.decision.enter()
    looks.looks(15)
    looks.look(legs=NEUTRAL + 0.003)
    assert looks.looks(40, legs=NEUTRAL + 0.003).index(Step.BEGIN) == 25
    looks.is_played = True
    looks.decision.enter()
    assert [looks.look(legs=NEUTRAL + 0.003 * (k % 2)) for k in range(21)][-1] is Step.HOME


def test_what_forbids_the_way_home_is_told_and_it_is_tried_again(looks) -> None:
    assert looks.waits() is Step.HOME
    looks.decision.wait_again("no way")
    told = "it cannot go home by itself: no way"
    assert (looks.decision.status, looks.decision.is_blocked) == (told, True)
    for _ in range(20):
        assert looks.look() is Step.WAIT
        assert (looks.decision.status, looks.decision.is_blocked) == (told, True)
    assert looks.look() is Step.HOME
    assert looks.decision.status == "it is on its way home"
    # once it goes, what forbade it before is not told again
    looks.look(400 * MS)
    assert looks.decision.status == PATIENT


def test_what_forbade_the_way_home_is_forgotten_with_another_state(looks) -> None:
    looks.waits()
    looks.decision.wait_again("no way")
    looks.decision.enter()
    assert (looks.decision.status, looks.decision.is_blocked) == ("", False)
    looks.look()
    assert (looks.decision.status, looks.decision.is_blocked) == (PATIENT, False)


def news(looks: Looks) -> str:
    return looks.decision.news(looks.now)


def test_before_a_look_nothing_is_new(looks) -> None:
    assert looks.decision.news(10 * SECOND) == ""


def test_every_step_is_new_once(looks) -> None:
    looks.is_neutral = True
    found = []
    for phase, count, told in (
        (None, 20, {}),
        (Phase.STARTING, 20, {}),
        (Phase.UP, 10, {"legs": NEUTRAL + 0.1}),
        (Phase.UP, 40, {}),
        (Phase.UP, 20, {"faults": ("bus",)}),
        (Phase.DOWN, 20, {}),
    ):
        for _ in range(count):
            looks.look(50 * MS, phase, **told)
            found.append(news(looks))
    assert [text for text in found if text] == [
        SILENT,
        "the device says STARTING; it is waited for",
        "the platform stands 100 mm from where it was sent: free it, or reset to bring it home "
        "from where it is measured",
        "it is being parked",
        "the device is told to park as long as it reports bus",
        "it is down; a reset makes it ready again",
    ]


def test_a_wait_is_no_news_but_what_forbids_the_way_home_is(looks) -> None:
    for _ in range(20):
        looks.look()
        assert news(looks) == ""
    looks.look()
    assert news(looks) == "it is on its way home"
    looks.decision.wait_again("no way")
    looks.look(NEWS)
    assert "no way" in news(looks)


def test_a_device_that_flickers_is_news_twice_a_second(looks) -> None:
    looks.now = NEWS - 51 * MS
    looks.look(phase=Phase.DOWN)
    assert news(looks) == "", "half a second of the computer has not passed"
    looks.look(1 * MS, phase=Phase.DOWN)
    assert news(looks) != ""
    looks.look(NEWS - 1, phase=Phase.STARTING)
    assert news(looks) == ""
    looks.look(1, phase=Phase.STARTING)
    assert "STARTING" in news(looks)


def test_in_another_state_the_same_is_news_again(looks) -> None:
    looks.now = SECOND
    looks.look(phase=Phase.DOWN)
    assert news(looks) != ""
    looks.decision.enter()
    looks.look(NEWS, phase=Phase.DOWN)
    assert news(looks) != ""
