"""What is wrong with packets reaches page, log, guard and client; a game's silence is its pause."""

import itertools
import logging
import struct

import pytest
from motion_protocol import (
    NOTICE_TEXT_MAX,
    Cue,
    Flags,
    Mode,
    Motion,
    Notices,
    decode_status,
    encode_cue,
)

from motionserver.core.safety.states import State
from motionserver.core.state import DriveMode
from motionserver.planner.inputs import PAUSE_NS, Input, Inputs
from motionserver.planner.options import InputOptions
from motionserver.planner.reply import StatusSender
from motionserver.planner.source_notices import Notice, NoticeLog, notices_of, spoken
from motionserver.planner.source_report import SourceReport

MS = 1_000_000
SECOND = 1000 * MS
START = 1_000_000_000_000
STILL = Motion((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), speed=0.0)
GAME = struct.pack("<4s21f", b"BNG1", *[0.0] * 11, 1.0, *[0.0] * 9)


class Scene:
    """A planner's inputs in virtual time; whoever sends is whoever the test says."""

    def __init__(self, kind="native", key=None, may_change=True) -> None:
        self.waiting: list[tuple[bytes, str, int]] = []
        self.replies: list[tuple[str, bytes]] = []
        options = InputOptions(kind, "127.0.0.1", 4600, key, "motion/0/in/cue", ())
        self.inputs = Inputs([Input(options, self)], lambda: may_change)
        self.report = SourceReport(self.inputs)
        self.status = StatusSender(self.inputs)
        self.key = key
        self.now = START
        self.sequence = 0
        self.newest = None

    def drain(self):
        waiting, self.waiting = self.waiting, []
        return waiting

    def reply(self, name: str, data: bytes) -> None:
        self.replies.append((name, data))

    def close(self) -> None:
        """Nothing is open."""

    def hear(self, data: bytes, address="10.0.0.2:5000", after=10 * MS) -> None:
        self.now += after
        self.waiting = [(data, address, self.now)]
        vehicle, _ = self.inputs.poll()
        self.newest = vehicle[-1] if vehicle else self.newest

    def cue(self, motion=STILL, stamp=None, after=10 * MS, **more) -> None:
        at = self.now + after if stamp is None else stamp
        self.hear(encode_cue(Cue(7, self.sequence, 0, at, motion, **more), self.key), after=after)
        self.sequence += 1

    def kinds(self) -> Notices:
        kinds = Notices.NONE
        for one in notices_of(self.inputs, self.now):
            kinds |= one.kind
        return kinds

    def answer(self):
        """What the client is told now; None if nothing."""
        self.replies.clear()
        notices = notices_of(self.inputs, self.now)
        self.status.send(self.now, self.newest, State.PARKED, 0.0, notices)
        return decode_status(self.replies[0][1], self.key) if self.replies else None


def test_a_good_source_gives_no_notice() -> None:
    scene = Scene()
    for _ in range(300):
        scene.cue()
    assert scene.kinds() is Notices.NONE
    told = scene.answer()
    assert told is not None
    assert (told.notices, told.notice_text) == (Notices.NONE, "")


def test_a_source_of_two_hertz_is_too_slow_and_never_fresh() -> None:
    scene = Scene()
    fresh = []
    for _ in range(40):
        scene.cue(after=500 * MS)
        gate, now = scene.inputs.vehicle, scene.now
        fresh += [gate.is_fresh(now + later * MS) for later in range(0, 500, 10)]
    changes = sum(a != b for a, b in itertools.pairwise(fresh))
    assert changes <= 7, "it flaps before it is known to be slow, not after"
    assert not any(fresh[200:])
    status = scene.report.status(scene.now, False)
    assert status.newest_ns == 0
    assert "too slow a source (2 Hz): at least 5 Hz are needed" in status.trouble
    told = scene.answer()
    assert told.notices is Notices.TOO_SLOW
    assert "too slow a source (2 Hz)" in told.notice_text
    for _ in range(10):
        scene.cue()
    assert scene.kinds() is Notices.NONE
    assert scene.inputs.vehicle.is_fresh(scene.now)


@pytest.mark.parametrize(("gap_ms", "slow"), [(200, False), (218, False), (250, True)])
def test_five_hertz_are_enough(gap_ms: int, slow: bool) -> None:
    scene = Scene()
    for _ in range(20):
        scene.cue(after=gap_ms * MS)
    assert (Notices.TOO_SLOW in scene.kinds()) is slow


def test_outages_of_a_quick_source_do_not_make_it_slow() -> None:
    scene = Scene()
    for _ in range(5):
        for _ in range(30):
            scene.cue()
        scene.cue(after=1600 * MS)
        assert scene.kinds() is Notices.NONE


@pytest.mark.parametrize(
    ("stamp", "said"), [(lambda now: 0, "does not advance"), (lambda now: now // 1000, "micro")]
)
def test_a_sender_time_that_is_no_clock_is_told_and_nothing_is_dropped(stamp, said) -> None:
    scene = Scene()
    for _ in range(600):
        scene.cue(stamp=stamp(scene.now + 10 * MS))
    assert scene.inputs.counters["refused"] == 0
    assert scene.kinds() is Notices.SENDER_TIME
    assert not any(one.keeps_parked for one in notices_of(scene.inputs, scene.now))
    status = scene.report.status(scene.now, False)
    assert (status.newest_ns, status.trouble) == (scene.now, "")
    told = scene.answer()
    assert said in told.notice_text
    assert told.notices is Notices.SENDER_TIME


def test_gravity_counted_twice_keeps_parked_and_is_told() -> None:
    scene = Scene()
    for _ in range(150):
        scene.cue(Motion((0.0, 0.0, 9.81), (0.0, 0.0, 0.0), speed=0.0))
    before, during = (scene.report.status(scene.now, begun) for begun in (False, True))
    assert (before.newest_ns, during.newest_ns) == (0, scene.now)
    assert "gravity is counted twice" in before.trouble
    assert during.trouble == ""
    told = scene.answer()
    assert told.notices is Notices.VALUES
    assert "GRAVITY_INCLUDED" in told.notice_text


@pytest.mark.parametrize("key", [None, b"k" * 32])
def test_a_client_of_which_all_is_refused_is_told_why(key) -> None:
    scene = Scene(key=key)
    for _ in range(20):
        scene.cue(Motion((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 5.0)))
    assert scene.inputs.vehicle.owner is None
    told = scene.answer()
    assert told.session == 7
    assert told.echo_sequence == 19
    assert told.notices is Notices.OUT_OF_RANGE
    assert "pitch 5 rad is beyond pi/2, no attitude: is it in degrees?" in told.notice_text
    assert scene.replies[0][0] == "10.0.0.2:5000"
    scene.now += 100 * MS
    assert scene.answer() is not None
    scene.now += 401 * MS
    assert scene.answer() is None, "nobody is there any more"


def test_a_stranger_beside_an_owner_is_not_answered() -> None:
    scene = Scene()
    for _ in range(20):
        scene.cue()
        bad = encode_cue(Cue(9, 1, 0, 0, Motion((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (170.0, 0.0))))
        scene.hear(bad, "10.0.0.3:1", after=0)
    assert scene.kinds() is Notices.NONE
    assert scene.answer().session == 7
    assert [name for name, _ in scene.replies] == ["10.0.0.2:5000"]


def test_answers_come_ten_times_a_second_and_end_with_the_client() -> None:
    scene = Scene()
    answers = 0
    for _ in range(100):
        scene.cue()
        answers += scene.answer() is not None
    assert 9 <= answers <= 11
    scene.now += 1900 * MS
    assert scene.answer() is not None
    scene.now += 200 * MS
    assert scene.answer() is None


def test_a_client_that_says_bye_sees_the_platform_park() -> None:
    scene = Scene()
    scene.cue()
    for _ in range(30):
        scene.cue(None, mode=Mode.BYE)
        scene.answer()
    scene.now += 100 * MS
    assert scene.answer().state.name == "PARKED"


def test_a_format_without_times_is_not_answered() -> None:
    scene = Scene("beamng")
    scene.hear(GAME)
    assert scene.answer() is None


def test_a_text_too_long_for_the_packet_is_cut_at_a_letter() -> None:
    text = spoken([Notice(Notices.VALUES, "ü" * 200)])
    assert len(text.encode()) == NOTICE_TEXT_MAX
    assert spoken([Notice(Notices.VALUES, "x" + "ü" * 200)]).encode()[-2:] == "ü".encode()


def test_the_log_tells_a_notice_once_while_it_lasts(caplog, monkeypatch) -> None:
    log = logging.getLogger("motionserver.planner")
    monkeypatch.setattr(log, "disabled", False)
    caplog.set_level("WARNING", log.name)
    notes = NoticeLog(log)
    slow, values = Notice(Notices.TOO_SLOW, "too slow"), Notice(Notices.VALUES, "twice")
    for now, told in ((0, [slow]), (1, [slow]), (2, [slow, values]), (3, []), (4, [slow])):
        notes.note(now * SECOND, told)
    assert [record.getMessage()[-8:] for record in caplog.records] == ["too slow", "r: twice"]
    notes.note(5 * SECOND, [])
    notes.note(10 * SECOND, [slow])
    assert len(caplog.records) == 3


def driven(kind: str, may_change=True) -> Scene:
    scene = Scene(kind, may_change=may_change)
    for _ in range(100):
        scene.hear(GAME, after=16 * MS) if kind == "beamng" else scene.cue(after=16 * MS)
    return scene


def test_a_games_silence_in_a_drive_is_its_pause() -> None:
    scene = driven("beamng")
    heard = scene.now
    status = scene.report.status(heard + 20 * MS, True)
    assert (status.mode, status.newest_ns) == (DriveMode.DRIVE, heard)
    for later in (100 * MS, 5 * SECOND, PAUSE_NS):
        status = scene.report.status(heard + later, True)
        assert status.mode is DriveMode.PAUSE
        assert status.newest_ns == heard + later, "no older than the planner's look"
        assert status.heard_ns == heard
        assert not status.is_stale(heard + later)
        assert status.is_stale(heard + later + 301 * MS), "a planner that dies is no pause"
    over = scene.report.status(heard + PAUSE_NS + 1, True)
    assert (over.mode, over.newest_ns) == (DriveMode.DRIVE, heard)
    scene.hear(GAME, after=300 * SECOND)
    assert scene.report.status(scene.now, True).mode is DriveMode.DRIVE


def test_before_a_drive_a_games_silence_is_a_silence() -> None:
    scene = driven("beamng")
    status = scene.report.status(scene.now + SECOND, False)
    assert (status.mode, status.newest_ns) == (DriveMode.DRIVE, scene.now)


def test_a_client_that_can_say_pause_is_lost_when_silent() -> None:
    scene = driven("native")
    status = scene.report.status(scene.now + SECOND, True)
    assert (status.mode, status.newest_ns) == (DriveMode.DRIVE, scene.now)


def test_a_slow_or_a_spoilt_game_does_not_pause() -> None:
    scene = Scene("beamng")
    for _ in range(10):
        scene.hear(GAME, after=500 * MS)
    assert scene.report.status(scene.now + 400 * MS, True).newest_ns == 0
    scene = driven("beamng")
    wild = struct.pack("<4s21f", b"BNG1", *[0.0] * 6, 1e4, *[0.0] * 14)
    for _ in range(30):
        scene.hear(wild)
    assert scene.report.status(scene.now, True).newest_ns == 0


def test_a_paused_game_may_return_on_another_port_of_its_host() -> None:
    scene = driven("beamng", may_change=False)
    scene.hear(GAME, "10.0.0.2:6000", after=SECOND)
    assert scene.inputs.counters["refused_second_client"] == 1
    scene.hear(GAME, "10.0.0.9:5000", after=2 * SECOND)
    assert scene.inputs.counters["refused_second_client"] == 2
    scene.hear(GAME, "10.0.0.2:6000", after=10 * MS)
    assert scene.inputs.counters["refused_second_client"] == 2
    assert scene.inputs.vehicle.owner.address == "10.0.0.2:6000"


def test_a_native_client_may_not_while_the_platform_is_up() -> None:
    scene = driven("native", may_change=False)
    scene.hear(encode_cue(Cue(8, 0, 0, 0, STILL)), "10.0.0.2:6000", after=3 * SECOND)
    assert scene.inputs.counters["refused_second_client"] == 1


def test_measured_flags_do_not_touch_the_vehicles_notices() -> None:
    scene = Scene()
    scene.cue(Motion((0.0, 0.0, 500.0), (0.0, 0.0, 0.0)), flags=Flags.MEASURED_AT_PLATFORM)
    assert scene.kinds() is Notices.NONE
    assert scene.inputs.out_of_range is None
