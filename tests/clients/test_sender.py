"""CueSender over real loopback sockets, with a clock of its own."""

import socket

import pytest
from motion_clients import CueSender
from motion_clients.address import parse_address
from motion_clients.outage import Outage
from motion_protocol import (
    Flags,
    Mode,
    NotFiniteError,
    PlatformState,
    Reference,
    Status,
    decode_cue,
    encode_status,
)

KEY = b"an example key of 32 bytes......"


class ManualClock:
    def __init__(self):
        self.now = 1_000_000_000

    def __call__(self):
        return self.now


@pytest.fixture
def server():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", 0))
        listener.settimeout(5.0)
        yield listener


def address_of(server):
    return f"127.0.0.1:{server.getsockname()[1]}"


def status_for(sender, **changes):
    values = {
        "session": sender.session, "sequence": 1, "sim_time_ns": 0, "send_time_ns": 503_000_000,
        "echo_sender_time_ns": 1_000_000_000, "receive_time_ns": 501_000_000, "echo_sequence": 0,
        "accepted_sequence": 0, "lost": 0, "reordered": 0, "rejected": 0, "scale": 1.0,
        "state": PlatformState.RUN,
    }  # fmt: skip
    return Status(**(values | changes))


def wait_for(sender, count):
    """Let the kernel hand over; loopback delivers in order and without loss."""
    for _ in range(1_000_000):
        sender.status()
        if sender.refused_replies + len(sender._round_trips) >= count:
            return
    raise AssertionError("replies did not arrive")


def test_sender_in_five_lines_says_drive_then_bye(server):
    with CueSender(address_of(server)) as cue:
        cue.send(acceleration=(1.0, 2.0, 3.0), rates=(0.25, 0.5, 0.75), speed=12.5)
    drive, bye = (decode_cue(server.recv(2000)) for _ in range(2))
    assert drive.motion.acceleration == (1.0, 2.0, 3.0)
    assert drive.motion.rates == (0.25, 0.5, 0.75)
    assert drive.motion.speed == 12.5
    assert drive.motion.attitude is None
    assert (drive.mode, drive.flags, drive.sequence) == (Mode.DRIVE, Flags(0), 0)
    assert (bye.mode, bye.motion, bye.sequence) == (Mode.BYE, None, 1)
    assert drive.session == bye.session == cue.session


def test_sender_keeps_times_sequence_and_modes(server):
    clock = ManualClock()
    with CueSender(address_of(server), session=7, clock_ns=clock) as cue:
        clock.now += 5
        cue.send(
            specific_force=(0.0, 0.0, 9.5),
            attitude=(0.125, 0.25),
            yaw=0.5,
            reference=Reference.SEAT,
            flags=Flags.STANDSTILL,
        )
        cue.pause(sim_time_ns=99)
        cue.teleport()
    cues = [decode_cue(server.recv(2000)) for _ in range(4)]
    assert [c.mode for c in cues] == [Mode.DRIVE, Mode.PAUSE, Mode.TELEPORT, Mode.BYE]
    assert [c.sequence for c in cues] == [0, 1, 2, 3]
    assert [c.sim_time_ns for c in cues] == [5, 99, 5, 5]
    assert {c.sender_time_ns for c in cues} == {1_000_000_005}
    assert cues[0].flags == Flags.STANDSTILL | Flags.GRAVITY_INCLUDED
    assert cues[0].motion.acceleration == (0.0, 0.0, 9.5)
    assert cues[1].motion.acceleration == (0.0, 0.0, 0.0)
    assert cues[1].motion.attitude == (0.125, 0.25)
    assert cues[1].motion.reference is Reference.SEAT
    assert cues[1].flags == Flags(0)


def test_sender_signs_with_a_key(server):
    with CueSender(address_of(server), key=KEY) as cue:
        cue.send((0.0, 0.0, 0.0))
    assert decode_cue(server.recv(2000), KEY).mode is Mode.DRIVE
    assert decode_cue(server.recv(2000), KEY).mode is Mode.BYE


def test_sequence_wraps(server):
    with CueSender(address_of(server)) as cue:
        cue._sequence = 2**32 - 1
        assert [cue.send((0.0, 0.0, 0.0)) for _ in range(2)] == [2**32 - 1, 0]


def test_a_signed_session_ends_before_its_sequence_wraps(server):
    with CueSender(address_of(server), key=KEY) as cue:
        first, cue._sequence = cue.session, 2**32 - 1
        assert [cue.send((0.0, 0.0, 0.0)) for _ in range(2)] == [2**32 - 1, 0]
        assert cue.session != first
    sent = [decode_cue(server.recv(2000), KEY) for _ in range(3)]
    assert [one.sequence for one in sent] == [2**32 - 1, 0, 1]
    assert sent[0].session == first
    assert sent[1].session == sent[2].session == cue.session


@pytest.mark.parametrize("key", [KEY, None])
def test_with_a_key_a_server_that_was_away_is_met_with_a_new_session(key):
    clock = ManualClock()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as unused:
        unused.bind(("127.0.0.1", 0))
        address = address_of(unused)
    with CueSender(address, key=key, clock_ns=clock) as cue:
        sessions = []
        for _ in range(40):
            cue.send((0.0, 0.0, 0.0))
            cue.status()
            clock.now += 20_000_000
            sessions.append(cue.session)
    assert len(set(sessions)) == (2 if key else 1)
    assert len(set(sessions[:20])) == 1


def test_an_outage_is_told_once_and_a_short_one_not_at_all():
    outage, ms = Outage(), 1_000_000
    assert not any(outage.refused(k * 100 * ms) for k in range(5))
    assert outage.refused(500 * ms)
    assert not any(outage.refused(k * 100 * ms) for k in range(6, 50))
    assert not outage.refused(60_000 * ms)
    assert not outage.refused(70_000 * ms)
    assert outage.refused(71_000 * ms)


def test_sender_wants_exactly_one_kind_of_acceleration(server):
    with CueSender(address_of(server)) as cue:
        with pytest.raises(ValueError, match="exactly one"):
            cue.send()
        with pytest.raises(ValueError, match="exactly one"):
            cue.send((0.0, 0.0, 0.0), specific_force=(0.0, 0.0, 9.8))
        with pytest.raises(NotFiniteError, match=r"acceleration\.x"):
            cue.send((float("nan"), 0.0, 0.0))
        assert cue.sent == 0


def test_sender_reads_status_and_measures_the_round_trip(server):
    clock = ManualClock()
    with CueSender(address_of(server), clock_ns=clock) as cue:
        assert cue.status() is None
        assert cue.round_trip is None
        assert cue.clock_offset_ns is None
        cue.send((0.0, 0.0, 0.0))
        _, client = server.recvfrom(2000)
        clock.now += 4_000_000
        server.sendto(encode_status(status_for(cue)), client)
        wait_for(cue, 1)
        # away 4 ms, held by the server 2 ms: 2 ms on the way, 1 ms each
        assert cue.round_trip == pytest.approx(0.002)
        assert cue.clock_offset_ns == 501_000_000 - 1_001_000_000
        assert cue.status() == status_for(cue)


def test_sender_hears_a_server_that_was_started_again(server):
    with CueSender(address_of(server)) as cue:
        cue.send((0.0, 0.0, 0.0))
        _, client = server.recvfrom(2000)
        for count, sequence in enumerate([5000, 4990, 0, 1], start=1):
            server.sendto(encode_status(status_for(cue, sequence=sequence)), client)
            wait_for(cue, count)
            seen = cue.status().sequence
            assert seen == (5000 if sequence == 4990 else sequence)


def test_sender_keeps_the_newest_status_and_counts_foreign_ones(server):
    with CueSender(address_of(server)) as cue:
        cue.send((0.0, 0.0, 0.0))
        _, client = server.recvfrom(2000)
        newest = status_for(cue, sequence=0, state=PlatformState.HOLD)
        replies = [
            encode_status(status_for(cue, sequence=2**32 - 1)),
            encode_status(newest),
            encode_status(status_for(cue, sequence=2**32 - 2)),
            encode_status(status_for(cue, session=cue.session ^ 1)),
            encode_status(status_for(cue), KEY),
            b"nonsense",
        ]
        for reply in replies:
            server.sendto(reply, client)
        wait_for(cue, len(replies))
        assert cue.status() == newest
        assert cue.refused_replies == 3


def test_nobody_listening_is_counted_and_not_raised():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as unused:
        unused.bind(("127.0.0.1", 0))
        address = address_of(unused)
    with CueSender(address) as cue:
        for _ in range(50):
            cue.send((0.0, 0.0, 0.0))
            cue.status()
        assert cue.sent + cue.unsent == 50
    cue.close()
    cue.send((0.0, 0.0, 0.0))
    assert cue.unsent >= 1
    assert cue.last_error is not None


@pytest.mark.parametrize(
    ("address", "meant"),
    [
        ("127.0.0.1:4601", ("127.0.0.1", 4601)),
        ("simulator", ("simulator", 4600)),
        ("[::1]:4602", ("::1", 4602)),
        ("[::1]", ("::1", 4600)),
    ],
)
def test_address_is_read(address, meant):
    assert parse_address(address, 4600) == meant


@pytest.mark.parametrize("address", ["", ":4600", "host:", "host:0", "host:65536", "host:x", "::1"])
def test_address_of_another_form_is_refused(address):
    with pytest.raises(ValueError, match="write for example"):
        parse_address(address, 4600)
