"""The planner's inputs: each sender has its decoder, each packet its counter."""

import socket
import struct
from collections.abc import Callable

import pytest
from motion_protocol import Cue, Flags, Motion, encode_cue

from motionserver.core.state import DriveMode, VehicleMotion
from motionserver.errors import ConfigError
from motionserver.planner.inputs import MOST_SENDERS, SHOWN_ERRORS, Input, Inputs, open_input
from motionserver.planner.inputs import log as room_log
from motionserver.planner.options import InputOptions
from motionserver.sources import udp as udp_module
from motionserver.sources.beamng import BeamNgSource
from motionserver.sources.udp import UdpInput

MS = 1_000_000
DRAIN = 16
MOTION = Motion((1.0, 0.0, 0.0), (0.0, 0.0, 0.0))


class Wire:
    """A transport whose datagrams the test lays down."""

    def __init__(self) -> None:
        self.waiting: list[tuple[bytes, str, int]] = []
        self.replies: list[tuple[str, bytes]] = []
        self.is_closed = False

    def drain(self) -> list[tuple[bytes, str, int]]:
        waiting, self.waiting = self.waiting, []
        return waiting

    def reply(self, name: str, data: bytes) -> None:
        self.replies.append((name, data))

    def close(self) -> None:
        self.is_closed = True


def options(kind: str, key: bytes | None = None) -> InputOptions:
    return InputOptions(kind, "127.0.0.1", 0, key, "motion/0/in/cue", ())


def game(x: float) -> bytes:
    return struct.pack("<4s21f", b"BNG1", x, *[0.0] * 20)


def room(kind: str = "native", key: bytes | None = None) -> tuple[Inputs, Wire]:
    wire = Wire()
    return Inputs([Input(options(kind, key), wire)], lambda: True), wire


def test_a_refused_game_far_away_is_no_teleport_of_the_owner() -> None:
    inputs, wire = room("beamng")
    modes = []
    for k in range(10):
        wire.waiting = [(game(0.1 * k), "own", 10 * k * MS), (game(9e3), "other", 10 * k * MS)]
        modes += [motion.mode for motion in inputs.poll()[0]]
    assert modes == [DriveMode.DRIVE] * 10
    assert inputs.counters["refused_second_client"] == 10


def test_many_senders_cost_no_memory() -> None:
    inputs, wire = room()
    for k in range(100):
        wire.waiting = [(b"?", f"10.0.0.{k}:1", k)]
        inputs.poll()
    assert len(inputs.inputs[0].formats) <= MOST_SENDERS
    assert inputs.counters["refused_size"] == 100


def test_the_log_tells_the_first_few(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    # whatever another test made of logging in this process
    monkeypatch.setattr(room_log, "disabled", False)
    caplog.set_level("WARNING", room_log.name)
    inputs, wire = room()
    wire.waiting = [(b"?", "a:1", k) for k in range(50)]
    inputs.poll()
    assert len(caplog.records) == SHOWN_ERRORS
    assert "native 127.0.0.1:0 from a:1" in inputs.last_error


def test_a_format_that_stumbles_costs_its_packet_only() -> None:
    inputs, wire = room()

    class Broken:
        name = "broken"

        def decode(self, data: bytes, arrival_ns: int) -> VehicleMotion:
            raise IndexError("of a third party")

    inputs.inputs[0].formats["bad:1"] = Broken()
    good = encode_cue(Cue(1, 1, 0, 0, MOTION))
    wire.waiting = [(b"x", "bad:1", 0), (good, "good:1", 1)]
    vehicle, _ = inputs.poll()
    assert len(vehicle) == 1
    assert inputs.counters["refused_decoder_failed"] == 1


def test_the_sensor_has_its_own_owner_and_must_say_that_it_is_one() -> None:
    inputs, wire = room("imu")
    measured = encode_cue(Cue(5, 1, 0, 0, MOTION, flags=Flags.MEASURED_AT_PLATFORM))
    wire.waiting = [(measured, "imu:1", 0), (encode_cue(Cue(5, 2, 0, 0, MOTION)), "imu:1", 1)]
    vehicle, sensor = inputs.poll()
    assert (len(vehicle), len(sensor)) == (0, 1)
    assert inputs.counters["refused_not_measured"] == 1
    assert inputs.vehicle.owner is None
    assert inputs.owner_key is None


def test_the_owner_is_answered_with_its_key() -> None:
    key = bytes(32)
    inputs, wire = room("native", key)
    inputs.reply(b"nobody")
    assert wire.replies == []
    wire.waiting = [(encode_cue(Cue(5, 1, 0, 0, MOTION), key), "sim:1", 0)]
    inputs.poll()
    assert inputs.owner_key == key
    inputs.reply(b"status")
    assert wire.replies == [("sim:1", b"status")]
    inputs.close()
    assert wire.is_closed


def test_an_unknown_kind_is_refused() -> None:
    with pytest.raises(ConfigError, match="Allowed: beamng"):
        open_input(options("morse"))


def test_inputs_open_by_kind() -> None:
    for kind in ("beamng", "imu", "native"):
        opened = open_input(options(kind))
        assert isinstance(opened.transport, UdpInput)
        opened.transport.close()
    assert opened.name == "native 127.0.0.1:0"


@pytest.fixture
def udp() -> Callable[[], UdpInput]:
    return lambda: UdpInput("127.0.0.1", 0)


def test_udp_is_drained_in_portions_and_answers_whom_it_heard(
    udp: Callable[[], UdpInput], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(udp_module, "DRAIN", DRAIN)
    server = udp()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.connect(tuple(server.address))
        for k in range(DRAIN + 3):
            link.send(bytes([k]))
        first = server.drain()
        assert [data[0] for data, _, _ in first] == list(range(DRAIN))
        assert len(server.drain()) == 3
        assert server.drain() == []
        server.reply(first[0][1], b"hello")
        link.settimeout(10.0)
        assert link.recv(10) == b"hello"
        server.reply("10.0.0.1:7", b"a stranger")
        server._peers = {f"10.0.0.{k}:1": ("10.0.0.1", 1) for k in range(DRAIN + 1)}
        link.send(b"again")
        server.drain()
        assert len(server._peers) == 1
    server.close()


def test_a_drain_empties_a_full_buffer(udp: Callable[[], UdpInput]) -> None:
    server = udp()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        for size in (1, 200, 1200):
            for _ in range(300):
                link.sendto(bytes(size), tuple(server.address))
            assert server.drain()
            assert server.drain() == []
    server.close()


def test_udp_says_when_a_port_is_held(udp: Callable[[], UdpInput]) -> None:
    server = udp()
    with pytest.raises(OSError, match="in use"):
        UdpInput("127.0.0.1", server.address[1])
    server.close()


def test_a_decoder_of_its_own_for_each_sender() -> None:
    source = Input(options("beamng"), Wire())
    for address in ("a", "b"):
        source.decode(game(0.0), address, 0)
    assert isinstance(source.formats["a"], BeamNgSource)
    assert source.formats["a"] is not source.formats["b"]


def plain_at(sequence: int, now: int) -> bytes:
    return encode_cue(Cue(1, sequence, 0, now, MOTION))


def signed(sequence: int, key: bytes | None, x: float = 1.0) -> bytes:
    motion = Motion((x, 0.0, 0.0), (0.0, 0.0, 0.0))
    cue = Cue(1, sequence, 0, 10 * sequence * MS, motion)
    return encode_cue(cue, key)


@pytest.mark.parametrize("key", [None, b"k" * 32])
def test_what_a_wire_damages_is_not_the_owners_fault(key: bytes | None) -> None:
    inputs, wire = room("native", key)
    for k in range(50):
        at = 10 * k * MS
        wire.waiting = [(signed(k + 1, key), "own", at), (b"junk", "own", at)]
        inputs.poll()
    assert inputs.vehicle.is_fresh(490 * MS)
    assert inputs.counters["refused_size"] == 50


def test_a_count_that_begins_anew_in_the_midst_is_a_teleport() -> None:
    inputs, wire = room()
    modes = []
    for k, sequence in enumerate([*range(500, 520), *range(20)]):
        wire.waiting = [(plain_at(sequence, 10 * k * MS), "own", 10 * k * MS)]
        modes += [motion.mode for motion in inputs.poll()[0]]
    assert modes == [DriveMode.DRIVE] * 20 + [DriveMode.TELEPORT] + [DriveMode.DRIVE] * 17
    assert inputs.counters["refused_reordered"] == 2


def test_an_attitude_in_degrees_is_refused_with_the_question() -> None:
    inputs, wire = room()
    for attitude, word in (((170.0, 0.0), "roll 170 rad"), ((0.0, 5.0), "pitch 5 rad")):
        told = Motion((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), attitude, None, 0.0)
        wire.waiting = [(encode_cue(Cue(1, 1, 0, 0, told)), "own", 0)]
        assert inputs.poll() == ([], [])
        assert word in inputs.last_error
        assert "is it in degrees?" in inputs.last_error
    assert inputs.counters["refused_out_of_range"] == 2


@pytest.mark.parametrize("size", [92, 96])
def test_outgauge_on_the_games_port_is_ignored_and_counted(size: int) -> None:
    inputs, wire = room("beamng")
    wire.waiting = [(bytes(size), "own", 0)]
    inputs.poll()
    assert "OutGauge" in inputs.last_error
    for k in range(50):
        at = 10 * k * MS
        wire.waiting = [(game(0.1 * k), "own", at), *[(bytes(size), "own", at)] * 3]
        inputs.poll()
    assert inputs.counters["ignored_outgauge"] == 151
    assert inputs.counters["refused"] == 0
    assert inputs.vehicle.spoilage.share(490 * MS) == 0.0
    assert inputs.vehicle.is_fresh(490 * MS)


@pytest.mark.parametrize("key", [None, b"k" * 32])
def test_what_cannot_be_is_the_owners_fault(key: bytes | None) -> None:
    inputs, wire = room("native", key)
    for k in range(50):
        x = 200.0 if k % 2 else 1.0
        wire.waiting = [(signed(k + 1, key, x), "own", 10 * k * MS)]
        inputs.poll()
    assert inputs.counters["refused_out_of_range"] == 25
    assert not inputs.vehicle.is_fresh(490 * MS)
