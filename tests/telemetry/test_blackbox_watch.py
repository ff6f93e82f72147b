"""What makes a dump, when, under what name; and what a disk that refuses costs."""

import json
import resource
import subprocess
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from device_model import Bench
from guard_scenes import away
from machines import compact

from motionserver.core.plan import pack
from motionserver.core.safety.given import TickInput
from motionserver.telemetry.blackbox.dump import SUFFIX, Trigger, collect, dumps, write_dump
from motionserver.telemetry.blackbox.guard_box import GuardBox
from motionserver.telemetry.blackbox.history import History
from motionserver.telemetry.blackbox.reader import DumpError, read_dump, summary, table, write_csv
from motionserver.telemetry.blackbox.room import FOLDER, clear_room, make_room
from motionserver.telemetry.blackbox.watch import AFTER_NS, SPACING_NS, Watch
from motionserver.telemetry.mapped import MappedFile

SECOND = 1_000_000_000
MINUTE = 60 * SECOND
BEGIN = datetime(2026, 3, 4, 5, 6, 7, tzinfo=UTC)


class Scene:
    """A run directory whose guard and service are this test's own."""

    def __init__(self, tmp_path, kept=5):
        self.run_dir, self.folder = tmp_path / "run", tmp_path / "state" / "blackbox"
        self.run_dir.mkdir()
        make_room(self.run_dir, 60.0, 60.0)
        self.events = History(self.run_dir / FOLDER / "guard_events.history")
        self.service = MappedFile(self.run_dir / "service.map", 8192)
        self.kept = kept
        self.now = 100 * SECOND
        self.deaths = []
        self.watch = self.watcher()

    def watcher(self):
        return Watch(
            self.run_dir,
            self.folder,
            self.kept,
            lambda: BEGIN + timedelta(microseconds=self.now // 1000),
        )

    def enters(self, state, reason="because"):
        event = {"t_ns": self.now, "what": "state", "before": "RUN", "state": state}
        self.events.write(json.dumps({**event, "reason": reason}).encode())

    def dies(self, name, status=-9, pid=77):
        self.deaths.append((self.now, name, status, pid))
        self.service.write(json.dumps({"deaths": self.deaths[-8:]}).encode())

    def run(self, seconds):
        end = self.now + int(seconds * SECOND)
        while self.now < end:
            self.now += SECOND // 10
            self.watch.look(self.now)
            self.watch.tell(self.now, 1)

    @property
    def names(self):
        return [dump.name.partition("Z-")[2].removesuffix(SUFFIX) for dump in dumps(self.folder)]


@pytest.fixture
def scene(tmp_path):
    scene = Scene(tmp_path)
    yield scene
    clear_room(scene.run_dir)


def test_fault_and_safe_are_written_a_second_later_and_nothing_else(scene):
    for state in ("PARKED", "RUN", "HOLD", "PARKING"):
        scene.enters(state)
    scene.run(3.0)
    assert scene.names == []
    scene.enters("FAULT", "the device reports OVERHEATED!")
    scene.run(0.9)
    assert scene.names == []
    scene.run(0.2)
    assert scene.names == ["fault-the-device-reports-overheated"]
    scene.enters("SAFE")
    scene.run(1.2)
    assert scene.names[-1] == "safe-because"
    assert scene.watch.shown["dumps"] == 2
    # a second fault of the same kind is a fault
    scene.enters("SAFE")
    scene.run(1.2)
    assert len(scene.names) == 3


def test_what_happens_together_is_one_dump_named_by_the_heaviest(scene):
    scene.dies("web")
    scene.dies("guard")
    scene.run(0.3)
    scene.enters("FAULT")
    scene.run(3.0)
    assert scene.names == ["fault-because"]
    texts = [one["text"] for one in read_dump(dumps(scene.folder)[0])["reasons"]]
    assert texts[2] == "FAULT: because"
    assert sorted(texts[:2]) == [
        "the guard, process 77, was killed by SIGKILL",
        "the web, process 77, was killed by SIGKILL",
    ]


def test_the_spare_that_took_over_dies_as_the_guard(scene):
    scene.events.write(json.dumps({"t_ns": 1, "what": "guard", "pid": 8}).encode())
    scene.dies("spare guard", 3, pid=8)
    scene.run(2.0)
    scene.dies("spare guard", -11, pid=9)
    scene.run(2.0)
    assert scene.names == ["died-guard", "died-spare-guard"]


def test_a_process_that_dies_all_the_time_fills_minute_after_minute(scene):
    for _ in range(100):
        scene.dies("web", 1)
        scene.run(2.0)
    assert AFTER_NS + 2 * SPACING_NS < 200 * SECOND
    assert len(scene.names) == 4
    # joined without a gap: every death is told, once
    reasons = [one["t_ns"] for d in dumps(scene.folder) for one in read_dump(d)["reasons"]]
    assert len(reasons) == len(set(reasons)) > 90


def test_the_oldest_go_and_the_newest_never(scene):
    for number in range(8):
        scene.enters("FAULT", f"number {number}")
        scene.run(1.5)
    assert scene.names == [f"fault-number-{number}" for number in range(3, 8)]
    # even if the wall clock was set back
    utc = BEGIN - timedelta(days=1)
    path = write_dump(scene.folder, {}, "early", utc, 5)
    assert path.exists()
    assert len(dumps(scene.folder)) == 5


def test_a_black_box_that_was_killed_goes_on_where_it_was(scene):
    scene.enters("FAULT", "one")
    scene.run(2.0)
    scene.enters("FAULT", "two")
    scene.run(0.5)
    scene.watch = scene.watcher()
    assert scene.watch.shown["dumps"] == 1
    scene.run(2.0)
    assert scene.names == ["fault-one", "fault-two"]
    scene.watch = scene.watcher()
    scene.run(2.0)
    assert len(scene.names) == 2


def test_a_full_disk_costs_the_dump_and_leaves_no_half_of_it(scene):
    scene.enters("FAULT", "one")
    scene.run(2.0)
    scene.enters("FAULT", "two")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, limits[1]))
    try:
        scene.run(2.0)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert scene.watch.shown["failed"] == 1
    assert str(scene.folder) in scene.watch.shown["error"]
    assert len(list(scene.folder.iterdir())) == 1
    scene.enters("FAULT", "three")
    scene.run(2.0)
    assert scene.names == ["fault-one", "fault-three"]


def test_a_full_tmpfs_costs_the_dump(scene):
    scene.folder.mkdir(parents=True)
    mount = ["mount", "-t", "tmpfs", "-o", "size=16k", "tmpfs", str(scene.folder)]
    if subprocess.run(mount, capture_output=True, check=False).returncode != 0:
        pytest.skip("may not mount")
    try:
        with pytest.raises(OSError, match="No space"), (scene.folder / "filler").open("wb") as file:
            file.write(bytes(1 << 20))
        scene.enters("FAULT")
        scene.run(2.0)
        assert scene.watch.shown["failed"] == 1
        assert "No space left" in scene.watch.shown["error"]
        assert [entry.name for entry in scene.folder.iterdir()] == ["filler"]
    finally:
        subprocess.run(["umount", str(scene.folder)], check=True)


class BoxedBench(Bench):
    """A bench on virtual time whose guard has a black box."""

    box = None

    def boxed(self, run_dir):
        self.box = GuardBox(run_dir, self.guard)
        inner = self.guard.tick

        def tick(given: TickInput):
            self.box.ticked(1000)
            setpoint, answers = inner(given)
            playback = self.guard.record.playback
            if given.proposal is not None and playback is not None:
                self.box.accepted(pack(playback.newest.plan))
            self.box.note(given, setpoint, answers, setpoint is not None)
            return setpoint, answers

        self.guard.tick = tick


def test_a_virtual_fault_is_dumped_as_it_was_played(scene, tmp_path):
    b = BoxedBench(compact())
    b.boxed(scene.run_dir)
    b.engaged()
    away(b)
    b.device.silent = True
    b.until("FAULT", 2.0)
    now = b.now
    data = collect(scene.run_dir, [Trigger(now, "fault", "FAULT: here")], now, BEGIN)
    path = write_dump(scene.folder, data, "fault", BEGIN, 5)
    data = read_dump(path)
    rows = [row for row in table(data, "guard_rows") if row["is_sent"]]
    assert len(rows) == len(b.sent)
    for row, setpoint in zip(rows, b.sent, strict=True):
        legs = [row[f"leg_m_{n}"] for n in range(1, 7)]
        assert legs == pytest.approx(setpoint.legs, abs=1e-9)
        assert row["order"] == setpoint.order
    accepted = [r for r in table(data, "guard_rows") if r["verdict"] == "accepted"]
    assert len(accepted) == b.record.counters["plans_accepted"]
    assert rows[-1]["state"] == "FAULT"
    newest = data["accepted"][-1]
    assert np.allclose(newest["pose"], b.record.playback.newest.plan.pose, atol=1e-9)
    text = summary(data)
    assert "FAULT" in text
    assert "no feedback from the device" in text
    count = write_csv(data, tmp_path / "out.csv")
    assert count == len(data["guard_rows"]["rows"])
    with pytest.raises(DumpError, match="there already"):
        write_csv(data, tmp_path / "out.csv")


def test_a_successor_goes_on_in_the_state_it_found(scene):
    b = BoxedBench(compact())
    b.engaged()
    b.boxed(scene.run_dir)
    b.run(0.2)
    events = [json.loads(data) for _, data in scene.events.since()]
    assert [event["what"] for event in events if event["what"] in ("state", "guard")] == ["guard"]


def test_what_is_no_dump_is_refused_in_words(tmp_path):
    path = tmp_path / f"x{SUFFIX}"
    for content in (b"", b"nonsense"):
        path.write_bytes(content)
        with pytest.raises(DumpError, match="no dump of the black box"):
            read_dump(path)
    with pytest.raises(DumpError, match="no dump"):
        read_dump(tmp_path / "none")


def test_an_error_of_the_box_is_counted_and_harms_no_tick(scene, monkeypatch):
    b = BoxedBench(compact())
    b.boxed(scene.run_dir)
    monkeypatch.setattr(b.box, "_row", lambda *_: 1 / 0)
    b.engaged()
    assert b.record.counters["blackbox_errors"] > 10
    assert b.state == "RUN"
