"""The demo waits in words, ends what cannot go on, and drives again after a fault."""

import asyncio
import json
import selectors

import pytest

from motionserver.cli import demo_drive, demo_watch
from motionserver.cli.demo_drive import Driver
from motionserver.cli.demo_watch import DemoError, FaultError, StateWatch
from motionserver.telemetry.mapped import MappedFile
from motionserver.telemetry.requests import RequestError


class Hurried(selectors.SelectSelector):
    """Nothing but timers wakes the loop: time jumps to the next one."""

    time = 0.0

    def select(self, timeout=None):
        self.time += timeout or 0.0
        assert self.time < 3600.0, "it waits for ever"
        return super().select(0)


class Scene:
    """A guard that a script moves, and what the demo says and asks meanwhile."""

    def __init__(self, folder):
        self.guard = MappedFile(folder / "guard.map", 4096)
        MappedFile(folder / "planner.map", 4096)
        self.folder = folder
        self.said = []
        self.asked = []
        self.answers = {"engage": (True, ""), "reset": (True, "")}
        self.ended = ""

    def put(self, state, reason="because"):
        self.guard.write(json.dumps({"state": state, "reason": reason}).encode())

    def ask(self, path, request):
        assert path == self.folder / "guard.sock"
        self.asked.append(request["op"])
        answer = self.answers[request["op"]]
        if isinstance(answer, Exception):
            raise answer
        return {"ok": answer[0], "state": "X", "reason": answer[1]}

    def check(self):
        if self.ended:
            raise DemoError(self.ended)

    def run(self, script, what):
        """Run ``what`` of a driver while the script puts states at its instants."""
        selector = Hurried()
        loop = asyncio.SelectorEventLoop(selector)
        loop.time = lambda: selector.time

        async def play():
            watch = StateWatch(self.folder, self.said.append, loop.time())
            driver = Driver(watch, self.folder, self.check)
            showing = asyncio.create_task(watch.show())
            for at, action in script:
                loop.call_later(at, action)
            try:
                await what(driver, watch)
            finally:
                showing.cancel()
            return driver

        with asyncio.Runner(loop_factory=lambda: loop) as runner:
            return runner.run(play())

    def step(self, state, reason="because"):
        return lambda: self.put(state, reason)

    @property
    def text(self):
        return "\n".join(self.said)


@pytest.fixture
def scene(tmp_path, monkeypatch):
    made = Scene(tmp_path)

    async def at_once(function, *arguments):
        return function(*arguments)

    monkeypatch.setattr(asyncio, "to_thread", at_once)
    monkeypatch.setattr(demo_drive, "ask", made.ask)
    monkeypatch.setattr(demo_watch, "line", lambda guard, planner: "figures")
    return made


def drive(seconds):
    async def what(driver, watch):
        await driver.reach_run()
        await driver.keep_driving(seconds)

    return what


RISE = [(1.0, "PARKED"), (2.0, "RAISING"), (4.0, "READY"), (4.5, "RUN")]


def rise(scene, begin=0.0):
    return [(begin + at, scene.step(state)) for at, state in RISE]


def test_a_guard_that_never_reports_ends_the_wait_in_words(scene):
    with pytest.raises(DemoError) as caught:
        scene.run([], drive(10.0))
    assert str(caught.value) == (
        "Timed out after 60 s waiting for state PARKED: the guard has not reported. "
        "The machine may be overloaded; run `motionserver doctor`."
    )
    assert "  waiting for state PARKED: the guard has not reported" in scene.text
    assert len(scene.said) == 11


def test_a_wait_names_the_state_it_is_stuck_in(scene):
    with pytest.raises(DemoError, match=r"OFFLINE \(no feedback\)"):
        scene.run([(1.0, scene.step("OFFLINE", "no feedback"))], drive(10.0))


def test_engaging_that_is_never_granted_ends_with_the_reason(scene):
    scene.answers["engage"] = (False, "no fresh source")
    with pytest.raises(DemoError, match=r"180 s waiting for engage .*PARKED|no fresh source"):
        scene.run([(1.0, scene.step("PARKED"))], drive(10.0))
    assert "waiting for engage to be granted: refused in X (no fresh source)" in scene.text


def test_a_guard_that_does_not_answer_is_asked_again_until_the_end(scene):
    scene.answers["engage"] = RequestError("nobody listens at guard.sock")
    with pytest.raises(DemoError, match="nobody listens"):
        scene.run([(1.0, scene.step("PARKED"))], drive(10.0))


def test_an_engage_whose_answer_was_lost_is_not_asked_again(scene):
    scene.answers["engage"] = RequestError("timed out")
    scene.run(rise(scene), drive(10.0))
    assert "RUN: because" in scene.text


def test_after_a_fault_the_demo_says_what_happened_and_drives_again(scene):
    script = [*rise(scene), (20.0, scene.step("FAULT", "no feedback for 104 ms"))]
    script += rise(scene, 23.0)
    driver = scene.run(script, drive(40.0))
    assert driver.faults == ["FAULT: no feedback for 104 ms"]
    assert scene.asked == ["engage", "reset", "engage"]
    for words in ("FAULT: no feedback for 104 ms", "resets by itself", "blackbox show",
                  "driving again after the fault"):  # fmt: skip
        assert words in scene.text


def test_a_fault_while_rising_is_reset_as_well(scene):
    script = [*rise(scene)[:2], (3.0, scene.step("FAULT")), *rise(scene, 5.0)]
    assert scene.run(script, drive(20.0)).faults == ["FAULT: because"]
    assert scene.asked == ["engage", "reset", "engage"]


def test_a_fault_whose_cause_stays_ends_the_demo_with_the_reason(scene):
    scene.answers["reset"] = (False, "the device reports a fault")
    with pytest.raises(DemoError, match=r"60 s waiting for reset .*the device reports a fault"):
        scene.run([*rise(scene), (20.0, scene.step("FAULT"))], drive(None))


def test_faults_again_and_again_end_the_demo(scene):
    script = []
    for number in range(demo_drive.MOST_FAULTS):
        begin = 20.0 * number
        script += [*rise(scene, begin), (begin + 10.0, scene.step("FAULT"))]
    with pytest.raises(DemoError, match="5 faults within 120 s, the last: FAULT: because"):
        scene.run(script, drive(None))


def test_a_base_that_ended_by_itself_ends_the_demo(scene):
    def end():
        scene.ended = "the emulator has ended by itself, status 1"

    with pytest.raises(DemoError, match="the emulator has ended"):
        scene.run([*rise(scene), (20.0, end)], drive(None))


def test_a_parked_platform_is_not_raised_again_but_how_to_is_said(scene):
    script = [*rise(scene), (20.0, scene.step("PARKING")), (24.0, scene.step("PARKED"))]
    scene.run(script, drive(60.0))
    assert scene.asked == ["engage"]
    assert scene.text.count("to drive on: Engage on the page") == 1


def test_somebody_who_parks_while_it_rises_is_obeyed(scene):
    script = [*rise(scene)[:2], (3.0, scene.step("PARKING")), (5.0, scene.step("PARKED"))]
    scene.run(script, drive(80.0))
    assert scene.asked == ["engage"]


def test_waiting_for_a_state_does_not_mind_the_fault_it_began_in(scene):
    async def what(driver, watch):
        await watch.until("FAULT")
        await watch.until("PARKED")

    scene.run([(1.0, scene.step("FAULT")), (5.0, scene.step("PARKED"))], what)

    async def again(driver, watch):
        await watch.until("RUN")

    scene.put("PARKED")
    with pytest.raises(FaultError, match="SAFE: e-stop"):
        scene.run([(1.0, scene.step("SAFE", "e-stop"))], again)


def test_figures_are_shown_once_a_second(scene):
    scene.run(rise(scene), drive(20.0))
    assert 14 <= scene.text.count("figures") <= 16
