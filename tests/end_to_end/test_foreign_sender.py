"""A sender written from protocol/README.md alone, with the clocks and habits of strangers.

    pytest -m campaign tests/end_to_end/test_foreign_sender.py -s

It knows the byte tables and nothing of our code. Its clock drifts and is set, its program is
started again with the same session, its network is away: the platform parks where it must, never
because of a clock.
"""

import json
import math
import socket
import struct
import threading
import time
import zlib
from dataclasses import dataclass
from pathlib import Path

import pytest
from rig import Rig, assert_soft, prompt

SECOND = 1_000_000_000
SEED = 0x1BA023E3
DRIFT_PPM = -500


def cue(session: int, sequence: int, sim_ns: int, sent_ns: int, ax: float, ay: float) -> bytes:
    """Bytes as in the tables: header, then block 1 of kinematic acceleration with all fields."""
    motion = struct.pack("<10fBB2x", ax, ay, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 15.0, 3, 7)
    payload = struct.pack("<HH", 1, len(motion)) + motion
    head = struct.pack(
        "<4sBBBBHHB3xIIQQ",
        b"MCUE", 1, 0, 0, 0, len(payload), 0, 0, session, sequence, sim_ns, sent_ns,
    )  # fmt: skip
    crc = zlib.crc32(payload, zlib.crc32(head, SEED))
    return head + struct.pack("<I", crc) + payload


def notice(status: bytes) -> tuple[int, str]:
    """Kinds and text of block 65; nothing if it is absent."""
    assert status[:4] == b"MCST"
    at = 44
    while at < len(status):
        kind, length = struct.unpack_from("<HH", status, at)
        if kind == 65:
            (kinds,) = struct.unpack_from("<H", status, at + 4)
            return kinds, status[at + 8 : at + 4 + length].decode()
        at += 4 + length
    return 0, ""


@dataclass
class Clock:
    """What the sender believes the time to be [ns]."""

    ppm: int = DRIFT_PPM
    step: int = 0

    def __call__(self) -> int:
        now = time.monotonic_ns()
        return 10**15 + now + now * self.ppm // 1_000_000 + self.step


class Sender(threading.Thread):
    """Sends 100 cues a second on one socket, so that its address stays the same."""

    def __init__(self, port: int) -> None:
        super().__init__(daemon=True)
        self.link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.link.bind(("127.0.0.1", 0))
        self.link.setblocking(False)
        self.peer = ("127.0.0.1", port)
        self.clock = Clock()
        self.stamp = self.clock
        self.sequence = 0
        self.is_silent = False
        self.ended = False
        self.kinds = 0
        self.text = ""

    def run(self) -> None:
        prompt()
        begin = time.monotonic()
        while not self.ended:
            t = time.monotonic() - begin
            if not self.is_silent:
                ax, ay = 1.5 * math.sin(0.9 * t), 1.2 * math.cos(0.7 * t)
                data = cue(1, self.sequence, int(t * SECOND), self.stamp() % (1 << 64), ax, ay)
                self.link.sendto(data, self.peer)
                self.sequence += 1
            self.read()
            time.sleep(0.01)

    def read(self) -> None:
        try:
            while True:
                self.kinds, self.text = notice(self.link.recv(1500))
        except BlockingIOError:
            return


@pytest.fixture
def driven(tmp_path: Path):
    with Rig(tmp_path, {"cueing": {"algorithm": "classical"}}) as rig:
        sender = Sender(rig.cue_port)
        sender.start()
        rig.engage()
        rig.wait_state("RUN")
        yield rig, sender
        sender.ended = True
        sender.join(10.0)
        sender.link.close()
        assert rig.end() == 0
        assert_soft(rig.verdict())


def stays(rig: Rig, seconds: float, allowed: frozenset[str]) -> set[str]:
    """States in that time; what is not allowed ends the test."""
    seen = set()
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        seen.add(rig.state)
        assert seen <= allowed, rig.story()
        time.sleep(0.02)
    return seen


RUN = frozenset({"RUN"})
HELD = frozenset({"RUN", "HOLD"})


@pytest.mark.campaign
@pytest.mark.timeout(900)
def test_a_foreign_sender_is_never_parked_for_its_clock(driven, capsys):
    rig, sender = driven
    # a busy machine may hold the sender or the server for a moment: HOLD may come, parking may not
    seen = {"drift of 300 s": stays(rig, 300.0, HELD)}
    old = {"drift of 300 s": rig.counter("refused_old")}
    for name, step in (("-0.2 s", -SECOND // 5), ("+1 h", 3600 * SECOND), ("+0.2 s", SECOND // 5)):
        sender.clock.step += step
        seen[name] = stays(rig, 10.0, HELD)
        old[name] = rig.counter("refused_old")
    sender.sequence += 1 << 30
    time.sleep(0.015)
    sender.sequence -= (1 << 30) + 1
    seen["one number far ahead"] = stays(rig, 5.0, HELD)

    sender.is_silent = True
    time.sleep(1.6)
    sender.is_silent = False
    seen["outage of 1.6 s"] = stays(rig, 10.0, HELD)
    rig.wait_state("RUN")

    sender.is_silent = True
    time.sleep(10.0)
    rig.wait_state("PARKED")
    # the program is started again: same session, counting from 0, its clock begins anew
    sender.sequence = 0
    sender.clock.step = -(10**15) - time.monotonic_ns()
    before = rig.counter("accepted")
    sender.is_silent = False
    rig.wait_for(lambda: rig.counter("accepted") > before + 50, "the restarted client to be heard")
    rig.engage()
    rig.wait_state("RUN")
    assert sender.kinds == 0, sender.text
    counters = rig.shown("planner")["counters"]
    figures = {k: v for k, v in counters.items() if k.startswith(("refused", "lost", "accepted"))}
    with capsys.disabled():
        print(json.dumps({"states": {k: sorted(v) for k, v in seen.items()}, "old": old}))
        print(json.dumps(figures))
    assert counters.get("refused_session_over", 0) == 0


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("stamp", "said"),
    [(lambda: 0, "does not advance"), (lambda: time.monotonic_ns() // 1000, "microseconds")],
    ids=["zero", "microseconds"],
)
def test_a_foreign_sender_without_a_clock_is_told_so_and_drives(driven, stamp, said):
    rig, sender = driven
    sender.stamp = stamp
    stays(rig, 20.0, HELD)
    assert said in sender.text
    assert sender.kinds == 1
    assert said in " ".join(rig.shown("planner")["source"]["notices"])
    assert said in rig.text()
    rig.wait_state("RUN")
