"""A signed session that was recorded moves nothing once its owner has left, nor after a restart."""

import os
import shutil
import socket
import stat
import threading
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motion_protocol import Cue, Flags, Mode, Motion, encode_cue

from motionserver.planner.inputs import Input, Inputs, open_input
from motionserver.planner.options import InputOptions
from motionserver.planner.session_file import SessionKeeper, packed, unpacked
from motionserver.planner.session_file import log as sessions_log
from motionserver.planner.sessions import MOST, OVER, Sessions

MS = 1_000_000
SECOND = 1000 * MS
KEY = bytes(range(32))
MOTION = Motion((1.0, 0.0, 0.0), (0.0, 0.0, 0.0))


class Wire:
    def __init__(self) -> None:
        self.waiting: list[tuple[bytes, str, int]] = []

    def drain(self) -> list[tuple[bytes, str, int]]:
        waiting, self.waiting = self.waiting, []
        return waiting

    def reply(self, name: str, data: bytes) -> None: ...

    def close(self) -> None: ...


class Server:
    """Inputs of one planner over a state directory that outlives it."""

    def __init__(self, folder: Path, key: bytes | None = KEY) -> None:
        self.folder, self.now = folder, 0
        self.options = InputOptions("native", "127.0.0.1", 0, key, "in/cue", ())
        self.start()

    @property
    def file(self) -> Path:
        return self.folder / "state" / "sessions.bin"

    def start(self) -> None:
        (self.folder / "run").mkdir(exist_ok=True)
        self.keeper = SessionKeeper(self.file, self.folder / "run" / "sessions.map")
        self.wire = Wire()
        self.inputs = Inputs([Input(self.options, self.wire)], lambda: True, self.keeper)

    def stop(self) -> None:
        """The service ends softly."""
        self.inputs.close()
        shutil.rmtree(self.folder / "run")

    def kill(self, *, service: bool) -> None:
        """The planner dies, or with it the service: its next start clears the run directory."""
        # not within the milliseconds a disk takes
        self.written()
        self.inputs.poll()
        self.written()
        self.keeper._thread.shutdown()
        if service:
            shutil.rmtree(self.folder / "run")

    def written(self) -> None:
        if self.keeper._writing is not None:
            self.keeper._writing.result(30)

    def hear(self, *packets: bytes, sender: str = "sim:1", later: int = 10 * MS) -> int:
        """How many of these are believed, one after the other."""
        believed = 0
        for packet in packets:
            self.now += later
            self.wire.waiting = [(packet, sender, self.now)]
            believed += sum(map(len, self.inputs.poll()))
        return believed

    def refused(self) -> int:
        return self.inputs.counters["refused_session_over"]


def drive(session: int, count: int, first: int = 0, mode: Mode = Mode.DRIVE) -> list[bytes]:
    return [
        encode_cue(Cue(session, k, k * 10 * MS, k * 10 * MS, MOTION, mode), KEY)
        for k in range(first, first + count)
    ]


@pytest.fixture
def server(tmp_path: Path) -> Server:
    return Server(tmp_path)


@pytest.mark.parametrize("sender", ["sim:1", "rogue:9"])
@pytest.mark.parametrize("goodbye", [True, False])
def test_a_recording_moves_nothing_once_its_owner_has_left(
    server: Server, sender: str, goodbye: bool
) -> None:
    tape = drive(7, 50) + drive(7, 1, 50, Mode.BYE if goodbye else Mode.DRIVE)
    assert server.hear(*tape) == 51
    server.now += 60 * SECOND
    assert server.hear(*tape, sender=sender) == 0
    reasons = ("refused_session_over", "refused_replayed", "refused_reordered")
    assert sum(server.inputs.counters[name] for name in reasons) == 51
    assert server.hear(*drive(8, 3), sender="sim:2") == 3


def test_a_recording_moves_nothing_while_another_drives_and_after(server: Server) -> None:
    tape = drive(7, 50)
    server.hear(*tape)
    server.now += 5 * SECOND
    assert server.hear(*drive(8, 20), sender="sim:2") == 20
    assert server.hear(*tape, sender="rogue:9") == 0
    server.now += 5 * SECOND
    assert server.hear(*tape) == 0
    assert server.refused() == 100


def test_what_was_refused_while_another_drove_cannot_be_played_either(server: Server) -> None:
    server.hear(*drive(7, 5))
    tape = drive(9, 50)
    assert server.hear(*tape, sender="other:1", later=0) == 0
    server.now += 5 * SECOND
    assert server.hear(*tape, sender="rogue:9") == 0


def test_who_plays_the_beginning_of_a_living_session_first_is_outrun_by_it(
    server: Server,
) -> None:
    """A client sends before the server is there; its packets are played the moment it comes."""
    tape = drive(7, 200)
    assert server.hear(tape[0], sender="rogue:9") == 1
    server.hear(tape[150])
    assert server.hear(*tape[1:150], sender="rogue:9") == 0
    server.now += 3 * SECOND
    assert server.hear(*tape[151:]) == 49


def test_the_owner_keeps_the_names_of_its_order(server: Server) -> None:
    tape = drive(7, 9)
    assert server.hear(tape[0], tape[5], tape[3], tape[5], tape[6]) == 3
    assert server.inputs.counters["refused_reordered"] == 1
    assert server.inputs.counters["refused_replayed"] == 1
    assert server.refused() == 0


@pytest.mark.parametrize("slips", [1, 2])
def test_one_number_far_ahead_does_not_end_a_signed_session(server: Server, slips: int) -> None:
    """Nor can who recorded it play it, before or after its session ended."""
    server.hear(*drive(7, 50))
    far = drive(7, slips, 1 << 30)
    assert server.hear(*far) == 0
    assert server.inputs.counters["refused_jumped"] == slips
    assert server.hear(*drive(7, 50, 50)) == 50
    for _ in range(3):
        assert server.hear(*far, *far, sender="rogue:9") == 0
    server.now += 60 * SECOND
    for _ in range(3):
        assert server.hear(*far, *far, sender="rogue:9") == 0
    server.kill(service=True)
    server.start()
    assert server.hear(*far, *far, sender="rogue:9") == 0


def test_a_signed_count_that_goes_on_far_ahead_is_followed_and_cannot_be_played(
    server: Server,
) -> None:
    server.hear(*drive(7, 50))
    tape = drive(7, 40, 1 << 30)
    assert server.hear(*tape) >= 35
    server.now += 5 * SECOND
    assert server.hear(*tape, *drive(7, 50), sender="rogue:9") == 0


def test_a_client_that_was_silent_goes_on_even_from_another_address(server: Server) -> None:
    server.hear(*drive(7, 5))
    server.now += 5 * SECOND
    assert server.hear(*drive(7, 5, 5), sender="sim:after-roaming") == 5
    server.now += 5 * SECOND
    assert server.hear(*drive(8, 5), sender="sim:2") == 5
    server.now += 5 * SECOND
    assert server.hear(*drive(7, 5, 10)) == 5


def test_after_a_soft_restart_a_living_client_goes_on_and_a_recording_does_not(
    server: Server,
) -> None:
    tape = drive(7, 50)
    server.hear(*tape)
    server.stop()
    server.start()
    assert server.hear(*tape, sender="rogue:9") == 0
    assert server.refused() == 50
    assert server.hear(*drive(7, 5, 50)) == 5


def test_a_killed_planner_leaves_how_far_it_came(server: Server) -> None:
    tape = drive(7, 50)
    server.hear(*tape)
    server.kill(service=False)
    server.start()
    assert server.hear(*tape, sender="rogue:9") == 0
    assert server.hear(*drive(7, 5, 50)) == 5


def test_after_a_power_cut_nothing_of_a_session_is_believed_until_it_is_renewed(
    server: Server,
) -> None:
    server.hear(*drive(7, 50))
    server.kill(service=True)
    server.start()
    assert server.hear(*drive(7, 100), sender="rogue:9") == 0
    assert "must take a new session number" in server.inputs.last_error
    assert server.hear(*drive(8, 5)) == 5


def test_sensor_and_vehicle_are_no_way_around_each_other(server: Server) -> None:
    cue = Cue(5, 1, 0, 0, MOTION, flags=Flags.MEASURED_AT_PLATFORM)
    assert server.hear(encode_cue(cue, KEY)) == 1
    server.now += 5 * SECOND
    assert server.hear(encode_cue(cue, KEY), sender="rogue:9") == 0


def test_without_a_key_nothing_is_remembered(tmp_path: Path) -> None:
    server = Server(tmp_path, None)
    packet = encode_cue(Cue(1, 0, 0, 0, MOTION))
    assert server.hear(packet) == 1
    server.now += 5 * SECOND
    assert server.hear(packet, sender="sim:2") == 1
    assert len(server.keeper.sessions) == 0
    assert not server.file.exists()


@given(
    heard=st.lists(st.tuples(st.integers(0, 3), st.integers(0, 30)), min_size=1, max_size=60),
    order=st.randoms(use_true_random=False),
    restart=st.sampled_from(["none", "soft", "planner", "service"]),
)
@settings(max_examples=60, deadline=None)
def test_whatever_was_heard_in_whatever_order_is_never_believed_again(
    tmp_path_factory: pytest.TempPathFactory,
    heard: list[tuple[int, int]],
    order: "object",
    restart: str,
) -> None:
    server = Server(tmp_path_factory.mktemp("replay"))
    tape = [drive(session, 1, sequence)[0] for session, sequence in heard]
    for k, packet in enumerate(tape):
        server.hear(packet, sender=f"sim:{heard[k][0]}", later=700 * MS)
    if restart == "soft":
        server.stop()
    elif restart != "none":
        server.kill(service=restart == "service")
    if restart != "none":
        server.start()
    again = list(tape)
    order.shuffle(again)  # type: ignore[attr-defined]
    server.now += 60 * SECOND
    assert server.hear(*again, sender="rogue:9", later=3 * SECOND) == 0
    server.inputs.close()


def test_recorded_from_the_wire_and_played_again(tmp_path: Path) -> None:
    options = InputOptions("native", "127.0.0.1", 0, KEY, "", ())
    keeper = SessionKeeper(tmp_path / "sessions.bin", tmp_path / "sessions.map")
    inputs = Inputs([open_input(options)], lambda: True, keeper)
    address = tuple(inputs.inputs[0].transport.address)  # type: ignore[attr-defined]
    tape = [*drive(7, 20), *drive(7, 1, 20, Mode.BYE)]

    def play(packets: list[bytes]) -> int:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
            for packet in packets:
                link.sendto(packet, address)
            return len(inputs.poll()[0])

    assert play(tape) == 21
    assert play(tape) == 0
    assert inputs.counters["refused_session_over"] == 21
    assert play(drive(8, 20)) == 20
    inputs.close()


def test_the_file_is_written_only_when_a_session_begins_and_not_by_the_tick(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    threads = []
    write = SessionKeeper._write

    def watched(self: SessionKeeper, marks: list[tuple[int, int]]) -> None:
        threads.append(threading.current_thread())
        write(self, marks)

    monkeypatch.setattr(SessionKeeper, "_write", watched)
    server.hear(*drive(7, 200))
    server.written()
    assert len(threads) == 1
    assert threads[0] is not threading.current_thread()
    assert unpacked(server.file.read_bytes()) == {7: OVER}
    assert stat.S_IMODE(server.file.stat().st_mode) == 0o600
    server.stop()
    assert unpacked(server.file.read_bytes()) == {7: 199}


def test_a_disk_that_hangs_is_not_waited_for(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    hangs, writes = threading.Event(), []
    monkeypatch.setattr(
        SessionKeeper, "_write", lambda _, marks: writes.append(marks) or hangs.wait(30)
    )
    for session in range(50):
        assert server.hear(*drive(session, 2), later=3 * SECOND) == 2
    assert len(writes) <= 1
    hangs.set()
    server.written()
    server.hear(*drive(49, 1, 2))
    server.written()
    assert len(writes) == 2
    assert len(writes[1]) == 50
    server.stop()


@pytest.mark.parametrize(
    "data", [b"", b"nonsense", packed([(7, 49)])[:-1], packed([(7, 49)])[:-1] + b"\1", b"\0" * 99]
)
def test_a_damaged_file_is_said_counted_put_aside_and_begun_anew(
    server: Server, data: bytes, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sessions_log, "disabled", False)
    server.stop()
    server.file.write_bytes(data)
    server.start()
    assert "give [[sources]] key_file a new key" in caplog.text
    assert server.hear(*drive(8, 5)) == 5
    assert server.inputs.counters["sessions_damaged"] == 1
    assert server.file.with_name("sessions.bin.damaged").read_bytes() == data
    server.stop()
    assert unpacked(server.file.read_bytes()) == {8: 4}


@pytest.mark.skipif(os.getuid() == 0, reason="root writes everywhere")
def test_a_folder_that_cannot_be_written_is_counted(server: Server) -> None:
    server.stop()
    server.file.parent.chmod(0o500)
    try:
        server.start()
        server.hear(*drive(8, 5))
        server.written()
        server.hear(*drive(8, 5, 5))
        assert server.inputs.counters["sessions_unsaved"] == 1
    finally:
        server.file.parent.chmod(0o700)


def test_a_file_instead_of_the_folder_is_counted(tmp_path: Path) -> None:
    (tmp_path / "state").write_text("in the way")
    server = Server(tmp_path)
    server.hear(*drive(8, 5))
    server.written()
    assert server.hear(*drive(8, 5, 5)) == 5
    # reading it failed, and writing it
    assert server.inputs.counters["sessions_unsaved"] == 1


@given(st.lists(st.tuples(st.integers(0, OVER), st.integers(0, OVER)), max_size=50))
def test_the_file_is_read_as_it_was_written(marks: list[tuple[int, int]]) -> None:
    kept = dict(marks)
    assert unpacked(packed(kept.items())) == kept


def test_the_bytes_of_the_file() -> None:
    assert packed([(7, 49)]).hex() == (
        "4d43534553533031"  # magic
        "01000000"  # one session
        "b4497027"  # CRC-32 of the rest
        "0700000031000000"
    )


def test_sessions_are_bounded_and_the_one_heard_last_stays() -> None:
    sessions = Sessions()
    sessions.hear(1, 5)
    for session in range(2, MOST + 1):
        sessions.hear(session, 0)
        sessions.hear(1, session)
    assert len(sessions) == MOST
    sessions.hear(MOST + 1, 0)
    assert len(sessions) == MOST
    assert sessions.hear(1, 5) == MOST
    assert sessions.hear(2, 0) == -1, "the one not heard for longest is forgotten"
    assert len(Sessions((k, 0) for k in range(MOST + 5))) == MOST
