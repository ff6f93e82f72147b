"""The base's answers are missing for a moment of a drive: real processes, nobody resets."""

import signal
from pathlib import Path

import pytest
from motion_clients.flawed_link import LinkFlaws
from rig import Rig, assert_soft

MISSING = 0.150
"""Half as long again as an answer may be missing [s]."""


def mute(rig: Rig, seconds: float) -> None:
    """The base hears and obeys; for so long, nothing that it says arrives."""

    def begin(emulator: object) -> None:
        rig.base._loop.call_later(seconds, end)
        rig.base.emulator.to_host.flaws = LinkFlaws(loss=1.0)

    def end() -> None:
        rig.base.emulator.to_host.flaws = LinkFlaws()

    rig.base.do(begin)


def is_parked(rig: Rig) -> bool:
    return bool(rig.base.do(lambda emulator: emulator.summary()["is_parked"]))


def is_down(rig: Rig) -> bool:
    return is_parked(rig) and rig.shown()["feedback"]["phase"] == "down"


@pytest.fixture
def rig(tmp_path: Path) -> object:
    with Rig(tmp_path, {"cueing": {"algorithm": "classical"}}) as one:
        one.run()
        one.wait_plans(60)
        yield one


def test_a_moment_without_answers_parks_by_itself_and_stays_latched(rig: Rig) -> None:
    mute(rig, MISSING)
    rig.wait_state("FAULT")
    rig.wait_for(lambda: is_down(rig), "the platform to be down")
    assert rig.state == "FAULT"
    refused = rig.ask("engage")
    assert not refused["ok"]
    assert "the state is FAULT" in refused["reason"]
    way = rig.transitions()
    assert [b for _, b in way].count("FAULT") == 1
    assert way[-1][1] == "FAULT"
    ready = "a reset makes it ready again"
    rig.wait_for(lambda: ready in rig.shown()["reason"], "word that it is down")
    assert rig.ask("reset")["ok"]
    rig.wait_state("PARKED")
    assert rig.end() == 0
    verdict = rig.verdict()
    assert_soft(verdict)
    assert verdict["is_parked"]


@pytest.mark.parametrize("first", ["answers", "service"])
def test_a_service_that_ends_in_it_parks_first(rig: Rig, first: str) -> None:
    if first == "service":
        rig.send_signal(signal.SIGTERM)
    mute(rig, MISSING)
    rig.wait_for(lambda: "-> FAULT" in rig.text(), "the fault")
    assert rig.end() == 0
    assert rig.base.emulator.summary()["is_parked"]
    verdict = rig.verdict()
    assert_soft(verdict)
    assert verdict["is_parked"]
    assert rig.transitions()[-1][1] == "FAULT", "it was latched to the end"
