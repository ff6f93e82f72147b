"""What the guard learns of the source: the age of its packets, and what is wrong with them."""

import struct

import numpy as np
from motion_protocol import Cue, Motion, encode_cue

from motionserver.planner.inputs import Input, Inputs
from motionserver.planner.options import InputOptions
from motionserver.planner.source_report import SourceReport

MS = 1_000_000
START = 1_000_000_000_000


class Wire:
    """A transport whose datagrams the test lays down."""

    def __init__(self) -> None:
        self.waiting: list[tuple[bytes, str, int]] = []

    def drain(self) -> list[tuple[bytes, str, int]]:
        waiting, self.waiting = self.waiting, []
        return waiting

    def reply(self, name: str, data: bytes) -> None:
        """Nobody listens."""

    def close(self) -> None:
        """Nothing is open."""


class Scene:
    """A planner's inputs and its report; the simulator sends what the test says."""

    def __init__(self) -> None:
        self.wire = Wire()
        options = InputOptions("native", "127.0.0.1", 4600, None, "motion/0/in/cue", ())
        self.inputs = Inputs([Input(options, self.wire)], lambda: True)
        self.report = SourceReport(self.inputs)
        self.now = START
        self.sequence = 0

    def send(self, data: bytes | None = None, rates: float = 0.0) -> None:
        self.now += 10 * MS
        self.sequence += 1
        cue = Cue(7, self.sequence, 0, self.now, Motion((0.0, 0.0, 9.81), (rates, 0.0, 0.0)))
        good = encode_cue(cue) if data is None else data
        self.wire.waiting = [(good, "10.0.0.2:5000", self.now)]
        self.inputs.poll()


def test_nothing_was_heard_and_nothing_is_wrong() -> None:
    scene = Scene()
    status = scene.report.status(START, False)
    assert (status.newest_ns, status.heard_ns, status.trouble) == (0, 0, "")
    assert status.looked_ns == START


def test_packets_that_are_refused_are_named_for_two_seconds() -> None:
    scene = Scene()
    scene.send(b"nonsense")
    trouble = scene.report.status(scene.now, False).trouble
    assert trouble.startswith("packets arrive and are refused; the last refusal: native")
    assert "10.0.0.2:5000" in trouble
    assert scene.report.status(scene.now + 2000 * MS, False).trouble == trouble
    assert scene.report.status(scene.now + 2001 * MS, False).trouble == ""


def test_a_stranger_that_is_refused_is_no_trouble_of_an_owner_that_is_fresh() -> None:
    scene = Scene()
    for _ in range(5):
        scene.send()
    scene.send(b"nonsense")
    status = scene.report.status(scene.now, True)
    assert status.trouble == ""
    assert status.newest_ns == status.heard_ns == scene.now - 10 * MS


def test_too_many_bad_packets_are_told_with_their_share() -> None:
    scene = Scene()
    for k in range(40):
        scene.send()
        if k % 2:
            bad = encode_cue(
                Cue(7, 1000 + k, 0, scene.now, Motion((0.0, 0.0, 1e6), (0.0, 0.0, 0.0)))
            )
            scene.send(bad)
    status = scene.report.status(scene.now, True)
    assert status.newest_ns == 0
    assert status.heard_ns > 0
    assert "% of the simulator's packets in the last second are bad" in status.trouble
    assert "the last refusal: native" in status.trouble


def test_wrong_units_are_told_before_a_drive_and_not_in_it() -> None:
    scene = Scene()
    for _ in range(700):
        scene.send(rates=float(np.degrees(0.2)))
    before, during = (scene.report.status(scene.now, cued) for cued in (False, True))
    assert "is it sent in rad/s?" in before.trouble
    assert (before.newest_ns, before.heard_ns) == (0, scene.now)
    assert (during.newest_ns, during.trouble) == (scene.now, "")


def test_a_long_sentence_has_room_in_the_record() -> None:
    from motionserver.telemetry.link import pack_cue, unpack_cue

    scene = Scene()
    scene.send(struct.pack("<4s21f", b"BNG1", *[0.0] * 21))
    status = scene.report.status(scene.now, False)
    assert unpack_cue(pack_cue(status, scene.now)) == status
