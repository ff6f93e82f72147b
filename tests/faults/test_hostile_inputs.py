"""Whatever reaches the ports is counted under its name; the platform goes on, softly."""

import contextlib
import math
import socket
import struct
import threading
import time
import zlib
from collections.abc import Iterator
from pathlib import Path

import pytest
from motion_clients.sender import CueSender
from motion_protocol import Cue, Motion, encode_cue
from motion_protocol.cue import CUE_LAYOUT
from rig import Rig, assert_soft, free_port, prompt

KEY = bytes(range(32))
LEVEL = Motion((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


@pytest.fixture
def link() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as opened:
        yield opened


def good(sequence: int = 1, session: int = 77) -> bytearray:
    return bytearray(encode_cue(Cue(session, sequence, 0, time.monotonic_ns(), LEVEL)))


def numberless() -> bytes:
    """A well-formed packet but for one value that is no number; its checksum is right."""
    packet = good()
    struct.pack_into("<f", packet, 48, math.nan)
    head = zlib.crc32(packet[:40], zlib.crc32(CUE_LAYOUT))
    struct.pack_into("<I", packet, 40, zlib.crc32(packet[44:], head))
    return bytes(packet)


def hostile() -> dict[str, bytes]:
    """One packet for every counter that needs no key and no owner."""
    swapped, version, incompat, damaged = good(), good(), good(), good()
    swapped[:4] = swapped[:4][::-1]
    version[4] = 9
    incompat[6] = 0x80
    damaged[50] ^= 1
    return {
        "size": b"x",
        "magic": b"BNG1" + bytes(84),
        "byte_order": bytes(swapped),
        "version": bytes(version),
        "incompat": bytes(incompat),
        "length": bytes(good()[:-1]),
        "checksum": bytes(damaged),
        "hmac_unexpected": encode_cue(Cue(77, 1, 0, 0, LEVEL), KEY),
        "second_client": bytes(good()),
    }


def test_every_refusal_has_a_name_and_the_drive_goes_on(
    tmp_path: Path, link: socket.socket
) -> None:
    signed, beam = free_port(), free_port()
    (tmp_path / "key").write_bytes(KEY)
    (tmp_path / "key").chmod(0o600)
    sources = (
        {"kind": "native", "listen": f"127.0.0.1:{signed}", "key_file": str(tmp_path / "key")},
        {"kind": "beamng", "listen": f"127.0.0.1:{beam}"},
    )
    with Rig(tmp_path, sources=sources) as rig:
        rig.run()
        cues = ("127.0.0.1", rig.cue_port)
        for name, packet in hostile().items():
            link.sendto(packet, cues)
            rig.wait_for(lambda n=name: rig.counter(f"refused_{n}") >= 1, f"the count of {name}")
        size = rig.counter("refused_size")
        link.sendto(bytes(60000), cues)
        rig.wait_for(lambda: rig.counter("refused_size") == size + 1, "the oversized packet")

        link.sendto(numberless(), cues)
        rig.wait_for(lambda: rig.counter("refused_not_finite") == 1, "the NaN")

        link.sendto(good(), ("127.0.0.1", signed))
        rig.wait_for(lambda: rig.counter("refused_hmac_missing") == 1, "the unsigned packet")
        link.sendto(encode_cue(Cue(77, 1, 0, 0, LEVEL), KEY[::-1]), ("127.0.0.1", signed))
        rig.wait_for(lambda: rig.counter("refused_hmac_wrong") == 1, "the wrong signature")

        # another game is refused, and its far-away vehicle is no teleport of ours
        link.sendto(struct.pack("<4s21f", b"BNG1", *[9e3] * 3, *[0.0] * 18), ("127.0.0.1", beam))
        rig.wait_for(lambda: rig.counter("refused_second_client") == 2, "the second game")

        # the platform's own port: garbage, a forged reply from elsewhere
        platform = ("127.0.0.1", platform_port(rig))
        link.sendto(b"garbage", platform)
        link.sendto(bytes(40), platform)
        rig.wait_for(lambda: rig.counter("feedback_foreign", "guard") == 2, "foreign feedback")
        garbage = rig.base.do(lambda e: e._transport.sendto(b"short", platform))
        assert garbage is None
        rig.wait_for(lambda: rig.counter("feedback_size", "guard") == 1, "the short reply")
        wrong = struct.pack(">III6fI", 0, 1, 3, *[math.nan] * 6, 0)
        rig.base.do(lambda e: e._transport.sendto(wrong, platform))
        rig.wait_for(lambda: rig.counter("feedback_not_finite", "guard") == 1, "NaN feedback")

        rig.wait_plans(20)
        assert rig.state == "RUN"
        assert set(rig.shown("service")["restarts"].values()) == {0}
        assert rig.counter("tick_errors") == rig.counter("tick_errors", "guard") == 0
        refused = rig.text().count("packet refused")
        assert 10 <= refused <= 30
        assert rig.end() == 0
        verdict = rig.verdict()
    assert_soft(verdict)


def platform_port(rig: Rig) -> int:
    hosts = rig.base.do(lambda emulator: list(emulator._hosts))
    return int(hosts[0][1])


def test_order_and_replay_are_counted(tmp_path: Path) -> None:
    with Rig(tmp_path) as rig, contextlib.ExitStack() as stack:
        rig.wait_state("PARKED")
        rig.wait_for(lambda: rig.shown("planner"), "the planner")
        own = stack.enter_context(CueSender(f"127.0.0.1:{rig.cue_port}", session=77))
        own.send((0.0, 0.0, 0.0))
        rig.wait_for(lambda: rig.counter("accepted") == 1, "the first")
        link = own._socket
        link.send(good(5))
        rig.wait_for(lambda: rig.counter("accepted") == 2, "the fifth")
        assert rig.counter("lost_packets") == 4
        link.send(good(5))
        rig.wait_for(lambda: rig.counter("refused_replayed") == 1, "the replay")
        link.send(good(3))
        rig.wait_for(lambda: rig.counter("refused_reordered") == 1, "the reordered")
        wild = encode_cue(Cue(77, 6, 0, time.monotonic_ns(), Motion((500.0, 0, 0), (0, 0, 0))))
        link.send(wild)
        rig.wait_for(lambda: rig.counter("refused_out_of_range") == 1, "the wild")
        late = encode_cue(Cue(77, 7, 0, time.monotonic_ns() - 10**9, LEVEL))
        link.send(late)
        rig.wait_for(lambda: rig.counter("refused_old") == 1, "the old")
        assert rig.counter("accepted") == 2
        # engaging on a source that has gone is refused, in words
        own.bye()
        rig.wait_for(lambda: not rig.shown()["source"]["fresh"], "silence")
        answer = rig.ask("engage")
        assert not answer["ok"]
        assert "source" in answer["reason"]
        assert rig.end() == 0
        assert rig.verdict()["positions"] == 0


def flood(port: int, stop: threading.Event, per_second: int) -> None:
    """Garbage at a rate, on an absolute grid; what the machine cannot send is left out."""
    prompt()
    packets = [b"?" * 200, bytes(good(1)), b"MCUE" + bytes(100), b""]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.connect(("127.0.0.1", port))
        batch = max(1, per_second // 500)
        due = time.monotonic()
        while not stop.is_set():
            for k in range(batch):
                with contextlib.suppress(OSError):
                    link.send(packets[k % len(packets)])
            due = max(due + batch / per_second, time.monotonic() - 0.1)
            time.sleep(max(0.0, due - time.monotonic()))


def test_a_flood_of_garbage_beside_a_client_changes_nothing(tmp_path: Path) -> None:
    with Rig(tmp_path) as rig:
        rig.run()
        before, packets = rig.shown()["counters"], rig.counter("packets")
        assert rig.counter("dropped_by_kernel") == 0
        stop = threading.Event()
        flooder = threading.Thread(target=flood, args=(rig.cue_port, stop, 5000), daemon=True)
        flooder.start()
        began = time.monotonic()
        rig.wait_for(lambda: time.monotonic() - began > 2.0, "two seconds of flood")
        stop.set()
        flooder.join(10.0)
        rig.wait_plans(10)
        # those of the kernel never came as far as to be refused
        dropped = rig.counter("dropped_by_kernel")
        assert dropped > 3000
        assert rig.counter("packets") - packets + dropped > 4000
        assert rig.state == "RUN"
        assert rig.shown()["counters"]["entered_run"] == before["entered_run"]
        assert rig.text().count("packet refused") < 40
        assert rig.end() == 0
        verdict = rig.verdict()
    assert_soft(verdict)
