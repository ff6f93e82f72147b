"""The guard's ports: whatever lies in the mapped files or on the socket, it goes on."""

import os
import socket
import struct
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from motionserver.core.motion.player import Playback
from motionserver.core.plan import pack, rest_at
from motionserver.core.safety.accept import accept_rest
from motionserver.core.safety.given import GuardConfig
from motionserver.core.safety.record import GuardRecord
from motionserver.core.safety.verdict import AcceptedPlan, Reason
from motionserver.core.safety.watchdog import CueStatus
from motionserver.core.state import DriveMode
from motionserver.guard import ports
from motionserver.guard.options import GuardOptions
from motionserver.guard.ports import DRAIN, Ports, open_link
from motionserver.platforms.base import PlatformOptions
from motionserver.settings.machine import load_machine
from motionserver.telemetry.link import GuardClock, Maps, pack_cue, unpack_cue
from motionserver.telemetry.sieve import unsieve

SLOT = struct.Struct("<QII")


class Scene:
    def __init__(self, folder: Path, base: socket.socket, link: socket.socket) -> None:
        self.folder, self.base, self.link = folder, base, link
        self.maps = Maps(folder, create=True)
        self.counters: Counter[str] = Counter()
        machine = load_machine("t2-compact")
        self.options = GuardOptions(
            GuardConfig(machine, 1 / 60, 1 / 60),
            "moog-6dof2000e",
            PlatformOptions(length_offset=machine.leg_min),
            base.getsockname(),
            60.0,
            (),
            None,
            False,
        )
        self.ports = Ports(self.options, folder, link, self.counters)

    def spoil(self, name: str, offset: int, data: bytes) -> None:
        with (self.folder / f"{name}.map").open("r+b") as file:
            file.seek(offset)
            file.write(data)


@pytest.fixture
def scene(tmp_path: Path) -> Iterator[Scene]:
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as base,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as outer,
    ):
        base.bind(("127.0.0.1", 0))
        outer.bind(("127.0.0.1", 0))
        with open_link(outer.fileno()) as link:
            yield Scene(tmp_path, base, link)


def reply(state: int = 1) -> bytes:
    return struct.pack(">III6fI", 0, 1, state, *[0.1] * 6, 0)


def test_feedback_is_the_platforms_alone(scene: Scene) -> None:
    here = scene.link.getsockname()
    scene.base.sendto(reply(), here)
    for wrong in (b"", b"x" * 39, reply(6), struct.pack(">III6fI", 0, 1, 1, *[np.nan] * 6, 0)):
        scene.base.sendto(wrong, here)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.sendto(reply(), here)
    assert len(scene.ports.feedback()) == 1
    assert dict(scene.counters) == {
        "feedback": 1,
        "feedback_size": 2,
        "feedback_state": 1,
        "feedback_not_finite": 1,
        "feedback_foreign": 1,
    }


def test_a_flood_of_strangers_leaves_the_buffer_to_the_platform(scene: Scene) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        for _ in range(10 * DRAIN):
            stranger.sendto(b"?", scene.link.getsockname())
    scene.base.sendto(reply(), scene.link.getsockname())
    assert len(scene.ports.feedback()) == 1
    assert scene.counters["feedback_foreign"] == 10 * DRAIN
    assert scene.ports.feedback() == ()
    assert scene.counters["feedback_foreign"] == 10 * DRAIN


def test_where_the_kernel_does_not_help_a_flood_is_read_in_portions(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    unsieve(scene.link)
    monkeypatch.setattr(ports, "DRAIN", 16)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        for _ in range(20):
            stranger.sendto(b"?", scene.link.getsockname())
    assert scene.ports.feedback() == ()
    assert scene.counters["feedback_foreign"] == 16


def test_a_refused_filter_is_told_and_the_guard_goes_on(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert scene.ports.filter == "127.0.0.1 alone"
    monkeypatch.setattr(ports, "sieve", lambda *_: "the kernel refuses")
    unsieve(scene.link)
    other = Ports(scene.options, scene.folder, scene.link, scene.counters)
    assert other.filter == "none: the kernel refuses"
    scene.base.sendto(reply(), scene.link.getsockname())
    assert len(other.feedback()) == 1


def test_cues_are_read_once_and_nonsense_is_counted(scene: Scene) -> None:
    assert scene.ports.cue() is None
    status = CueStatus(5, 6, DriveMode.PAUSE)
    scene.maps.cue.write(pack_cue(status, 7))
    found = scene.ports.cue()
    assert found == status
    assert found is not None
    assert found.looked_ns == 7
    assert scene.ports.cue() is None
    scene.maps.cue.write(struct.pack("<QQBQ", 1, 1, 99, 1))
    assert scene.ports.cue() is None
    scene.maps.cue.write(b"short")
    assert scene.ports.cue() is None
    scene.maps.cue.write(struct.pack("<QQBQQ", 1, 1, 99, 1, 1))
    assert scene.ports.cue() is None
    assert scene.counters["cue_malformed"] == 3


def test_a_cue_status_carries_what_is_wrong_with_the_source(scene: Scene) -> None:
    status = CueStatus(0, 6, DriveMode.DRIVE, 4, "the body rate is 57 rad/s: is it in rad/s? °")
    scene.maps.cue.write(pack_cue(status, 7))
    assert scene.ports.cue() == status


def test_a_sentence_that_is_too_long_is_cut_and_one_that_is_none_is_made_printable(
    scene: Scene,
) -> None:
    scene.maps.cue.write(pack_cue(CueStatus(trouble="°" * 299), 7))
    found = scene.ports.cue()
    assert found is not None
    assert found.trouble == "°" * 150
    head = pack_cue(CueStatus(), 7)
    scene.maps.cue.write(head + b"two\nlines\x1b \xc3")
    found = scene.ports.cue()
    assert found is not None
    assert found.trouble == "two lines  "
    with pytest.raises(ValueError, match="a sentence of 301 bytes, allowed 300"):
        unpack_cue(head + b"x" * 301)


def test_proposals_are_read_once_and_nonsense_is_rejected(scene: Scene) -> None:
    assert scene.ports.proposal() is None
    scene.maps.proposal.write(pack(rest_at(np.zeros(6), 9)))
    found = scene.ports.proposal()
    assert found is not None
    assert found.plan_id == 9
    assert scene.ports.proposal() is None
    for nonsense in (b"", b"x" * 63, os.urandom(400)):
        scene.maps.proposal.write(nonsense)
        assert scene.ports.proposal() is None
    assert scene.counters["rejected_malformed"] == scene.counters["plans_rejected"] == 3


def told(scene: Scene) -> GuardClock:
    message = scene.maps.clock.read()
    assert message is not None
    return GuardClock.unpack(message[1])


def test_what_was_decided_about_a_plan_is_told_once_with_its_reason(scene: Scene) -> None:
    record = GuardRecord()
    assert not scene.ports.has_news(record)
    scene.maps.proposal.write(pack(rest_at(np.zeros(6), 9)))
    scene.ports.proposal()
    assert scene.ports.has_news(record)
    scene.ports.publish(1, 2, 3, record)
    assert not scene.ports.has_news(record)
    assert (told(scene).taken_id, told(scene).judged_id) == (9, 0)
    for number, why in enumerate(Reason, 10):
        record.judged_id, record.refusal = number, why
        record.counters[f"rejected_{why}"] += 1
        assert scene.ports.has_news(record)
        scene.ports.publish(1, 2, 3, record)
        assert not scene.ports.has_news(record)
        assert (told(scene).judged_id, told(scene).refused_because) == (number, why)
    assert told(scene).late_count == 1
    record.judged_id, record.refusal = 99, None
    scene.ports.publish(1, 2, 3, record)
    assert (told(scene).judged_id, told(scene).refused_because) == (99, None)


def test_it_is_told_how_many_plans_wait(scene: Scene) -> None:
    machine = scene.options.guard.machine
    accepted = accept_rest(machine, np.zeros(6), 5, machine.parked_pose[None])
    assert isinstance(accepted, AcceptedPlan)
    record = GuardRecord(playback=Playback(accepted, 0.0, (accepted, accepted)))
    scene.ports.publish(1, 2, 3, record)
    assert told(scene).waiting == 2


@pytest.mark.parametrize("seed", range(20))
def test_a_spoilt_file_costs_nothing_but_its_message(scene: Scene, seed: int) -> None:
    random = np.random.default_rng(seed)
    scene.maps.proposal.write(pack(rest_at(np.zeros(6), 9)))
    scene.maps.cue.write(pack_cue(CueStatus(5, 6), 7))
    for name in ("proposal", "cue", "clock", "accepted"):
        size = (scene.folder / f"{name}.map").stat().st_size
        begin = int(random.integers(8, min(size, 600)))
        scene.spoil(name, begin, random.bytes(min(size - begin, 2000)))
    scene.ports.proposal()
    scene.ports.cue()
    # the writers heal it: two messages later both slots are whole again
    for plan_id in (10, 11):
        scene.maps.proposal.write(pack(rest_at(np.zeros(6), plan_id)))
        scene.maps.cue.write(pack_cue(CueStatus(plan_id, 6), 7))
    found, status = scene.ports.proposal(), scene.ports.cue()
    assert found is not None
    assert status is not None
    assert (found.plan_id, status.newest_ns) == (11, 11)


def test_a_torn_slot_leaves_the_one_before(scene: Scene) -> None:
    scene.maps.cue.write(pack_cue(CueStatus(1, 6), 7))
    scene.maps.cue.write(pack_cue(CueStatus(2, 6), 7))
    newest = 8 + (scene.maps.cue.newest_sequence() & 1) * (SLOT.size + scene.maps.cue.capacity)
    scene.spoil("cue", newest + SLOT.size, b"\xff")
    found = scene.ports.cue()
    assert found is not None
    assert found.newest_ns == 1


def test_a_snapshot_that_is_too_long_is_counted(scene: Scene) -> None:
    scene.ports.show(b"{}")
    scene.ports.show(b" " * 40000)
    assert scene.counters["snapshots_too_long"] == 1
    assert scene.maps.guard.read() == (1, b"{}")
