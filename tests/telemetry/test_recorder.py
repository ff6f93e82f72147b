"""The recorder: a row per packet from the mapped files alone; a disk that refuses is said."""

import json
from pathlib import Path

import numpy as np
import pytest
from machines import compact
from motion_clients import read_recording

from motionserver.core.axes import frozen
from motionserver.core.kinematics.hexapod import leg_lengths
from motionserver.core.plan import Plan, pack, rest_at
from motionserver.core.safety.states import State
from motionserver.core.state import VehicleMotion
from motionserver.telemetry.cue_history import CueNotes, CueReader
from motionserver.telemetry.link import STATES, GuardClock, Maps
from motionserver.telemetry.recorded import RecordError, columns, read_recorded
from motionserver.telemetry.recorder import SILENT_NS, Recorder, write_recording
from motionserver.telemetry.trace import Trace

MS = 1_000_000
NAMES = ("classical", "mpc")


class Scene:
    def __init__(self, folder: Path) -> None:
        self.maps = Maps(folder, create=True)
        self.recorder = Recorder(self.maps, compact(), NAMES)

    def packet(self, sent_ms: int, newest: int, clock: float, written_ms: int = 0) -> None:
        sent, written = sent_ms * MS, max(sent_ms, written_ms) * MS
        run = STATES.index(State.RUN)
        self.maps.clock.write(GuardClock(run, newest, clock, sent, sent, written).pack())

    def trace(self, at_ms: int) -> None:
        sides = {"mpc": (0.4, 0.5, 0.6, 0.5), "stranger": (1.0, 1.0, 1.0, 1.0)}
        force = ((1.0, 2.0, 3.0), (0.1, 0.2, 0.3))
        self.maps.trace.write(Trace(at_ms * MS, "classical", 1.0, *force, sides).pack())

    def look(self) -> dict[str, str] | None:
        row = self.recorder.look()
        return None if row is None else dict(zip(columns(NAMES), row.split(","), strict=True))


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    return Scene(tmp_path)


def moving(plan_id: int, parent: int, begin: float, end: float) -> Plan:
    """From heave ``begin`` to ``end`` [m] within a second, taking over at 0.5 s."""
    pose = np.zeros((2, 6))
    pose[:, 2] = begin, end
    still = frozen(np.zeros((2, 6)))
    return Plan(plan_id, parent, 0.5, frozen([0.0, 1.0]), frozen(pose), still, still)


def test_a_row_per_packet_and_none_for_news_between_packets(scene: Scene) -> None:
    assert scene.look() is None
    scene.maps.accepted.write(pack(rest_at(np.zeros(6), 5)))
    scene.packet(1000, 5, 0.1)
    first = scene.look()
    assert first is not None
    assert (first["time_s"], first["state"]) == ("0.000000", "RUN")
    assert scene.look() is None
    scene.packet(1000, 5, 0.104, written_ms=1004)
    assert scene.look() is None
    scene.packet(1017, 5, 0.117)
    assert (scene.look() or {})["time_s"] == "0.017000"
    assert scene.recorder.rows == 2


def test_a_plan_that_waits_shows_its_parent(scene: Scene) -> None:
    scene.maps.accepted.write(pack(rest_at(np.array([0, 0, 0.03, 0, 0, 0.0]), 5)))
    scene.packet(1, 5, 0.4)
    assert (scene.look() or {})["heave_m"] == "0.030000"
    scene.maps.accepted.write(pack(moving(6, 5, 0.03, 0.05)))
    scene.packet(2, 6, -0.1)
    assert (scene.look() or {})["heave_m"] == "0.030000"
    scene.packet(3, 6, 0.5)
    row = scene.look() or {}
    assert row["heave_m"] == "0.040000"
    legs = leg_lengths(compact(), np.array([0, 0, 0.04, 0, 0, 0.0]))
    np.testing.assert_allclose([float(row[f"leg_{k}_m"]) for k in range(1, 7)], legs, atol=1e-6)


def test_without_a_plan_the_guards_word_counts_and_without_that_nothing(scene: Scene) -> None:
    scene.packet(1, 0, 0.0)
    assert (scene.look() or {})["surge_m"] == ""
    pose = [0.01, 0.0, -0.17, 0.0, 0.0, 0.0]
    scene.maps.guard.write(json.dumps({"pose": pose}).encode())
    scene.packet(2, 0, 0.0)
    assert (scene.look() or {})["heave_m"] == "-0.170000"
    scene.packet(3, 99, -0.2)
    assert (scene.look() or {})["surge_m"] == "0.010000"


def test_a_plan_accepted_between_the_two_looks_is_not_taken_for_the_guards_old_word(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene.maps.guard.write(json.dumps({"pose": [0.0, 0.0, -0.17, 0.0, 0.0, 0.0]}).encode())
    scene.maps.accepted.write(pack(rest_at(np.array([0, 0, 0.03, 0, 0, 0.0]), 5)))
    scene.packet(1, 5, 0.4)
    assert (scene.look() or {})["heave_m"] == "0.030000"
    read = scene.maps.clock.read

    def while_reading() -> object:
        scene.maps.accepted.write(pack(moving(6, 5, 0.03, 0.05)))
        scene.packet(2, 6, 0.5)
        return read()

    scene.packet(2, 6, 0.5)
    monkeypatch.setattr(scene.maps.clock, "read", while_reading)
    assert (scene.look() or {})["heave_m"] == "0.040000"
    monkeypatch.undo()
    # one that was replaced before it could be read leaves the field empty, and invents nothing
    scene.packet(3, 7, 0.1)
    assert (scene.look() or {})["heave_m"] == ""


def test_forces_of_every_engine_that_ran_while_they_are_of_now(scene: Scene) -> None:
    scene.trace(100)
    scene.packet(110, 0, 0.0)
    row = scene.look() or {}
    assert [row[f"wanted_{a}_m_s2"] for a in "xyz"] == ["1.00000", "2.00000", "3.00000"]
    assert (row["felt_x_m_s2"], row["algorithm"], row["kappa"]) == ("0.10000", "classical", "1")
    assert (row["mpc_y_m_s2"], row["mpc_kappa"], row["classical_x_m_s2"]) == ("0.5", "0.5", "")
    scene.packet(900, 0, 0.0)
    row = scene.look() or {}
    assert row["wanted_x_m_s2"] == row["algorithm"] == row["mpc_kappa"] == ""


class Run:
    """Virtual time: a packet at every pause."""

    def __init__(self, scene: Scene, packets: int) -> None:
        self.scene, self.packets, self.now = scene, packets, 0

    def clock(self) -> int:
        return self.now

    def pause(self, seconds: float) -> None:
        self.now += int(max(seconds, 0.0167) * 1e9)
        if self.packets:
            self.packets -= 1
            self.scene.trace(self.now // MS)
            self.scene.packet(self.now // MS, 5, 0.0)

    def write(self, out: Path) -> str:
        return write_recording(
            self.scene.recorder,
            NAMES,
            out,
            now_ns=self.clock,
            pause=self.pause,
            is_over=lambda: self.now > 60 * SILENT_NS,
        )


def test_what_is_written_is_read_again(scene: Scene, tmp_path: Path) -> None:
    out = tmp_path / "drive.csv"
    scene.maps.accepted.write(pack(rest_at(np.zeros(6), 5)))
    assert Run(scene, 300).write(out) == "the server ended"
    recorded = read_recorded(out)
    assert recorded.engines == ("mpc",)
    assert recorded.words["algorithm"] == ["classical"] * 300
    np.testing.assert_allclose(recorded.force("mpc"), np.tile([0.4, 0.5, 0.6], (300, 1)))
    assert np.isnan(recorded.force("classical")).all()
    assert recorded.numbers["time_s"][-1] == pytest.approx(299 * 0.0167, rel=0.03)
    # a line that was cut off by a full disk or a power cut is left out
    out.write_text(out.read_text()[:-30])
    assert len(read_recorded(out).numbers["time_s"]) == 299


def test_what_the_simulator_said_stands_beside_it_with_all_settings(tmp_path: Path) -> None:
    scene = Scene(tmp_path)
    scene.recorder = Recorder(scene.maps, compact(), NAMES, CueReader(tmp_path), {"head": 1})
    notes = CueNotes(tmp_path)
    force = frozen([1.0, 2.0, 12.81])
    motions = [
        VehicleMotion(k * 10 * MS, 7, k, k * 10 * MS, force, frozen(np.zeros(3)), 5.0)
        for k in range(1, 101)
    ]
    scene.packet(100, 0, 0.0)
    notes.note(motions[:50])
    out = tmp_path / "drive.csv"
    now = 100

    def pause(_: float) -> None:
        nonlocal now
        now += 17
        if now == 117:
            notes.note(motions[50:])
        algorithm = "mpc" if now < 300 else "classical"
        tuning = {"tuning": {"values": {"algorithm": algorithm, "scale": 0.6}}}
        scene.maps.planner.write(json.dumps(tuning).encode())
        scene.packet(now, 0, 0.0)

    write_recording(
        scene.recorder, NAMES, out, now_ns=lambda: now * MS, pause=pause, is_over=lambda: now > 1000
    )
    read = read_recording(out)
    # those before the first row of the platform are left out, and no later one
    assert [round(s.time, 6) for s in read.samples] == [
        pytest.approx(0.01 * k, abs=1e-6) for k in range(91)
    ]
    assert read.samples[3].acceleration == pytest.approx((1.0, 2.0, 3.0))
    assert [json.loads(text) for _, text in read.settings] == [
        {"head": 1, "tuning": {"algorithm": name, "scale": 0.6}} for name in ("mpc", "classical")
    ]
    assert [at for at, _ in read.settings] == pytest.approx([0.017, 0.204])
    assert read.states == ((0.0, "RUN"),)
    assert scene.recorder.cue_rows == 91
    # the reader of the platform's columns takes the rows of the platform alone
    assert len(read_recorded(out).numbers["time_s"]) == scene.recorder.rows


def test_a_full_disk_is_said(scene: Scene) -> None:
    with pytest.raises(RecordError, match=r"No space left.*motion goes on"):
        Run(scene, 300).write(Path("/dev/full"))


def test_a_file_is_never_replaced(scene: Scene, tmp_path: Path) -> None:
    out = tmp_path / "old.csv"
    out.write_text("precious")
    with pytest.raises(RecordError, match="there already"):
        Run(scene, 3).write(out)
    assert out.read_text() == "precious"
    with pytest.raises(RecordError, match="No such file"):
        Run(scene, 3).write(tmp_path / "missing" / "x.csv")


@pytest.mark.parametrize(
    "text", ["", "a,b\n1,2\n", ",".join(columns(NAMES)) + "\n" + "x," * 29 + "x"]
)
def test_what_is_no_recording_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "x.csv"
    path.write_text(text)
    with pytest.raises(RecordError):
        read_recorded(path)
    with pytest.raises(RecordError, match="cannot be read"):
        read_recorded(tmp_path / "missing.csv")


@pytest.mark.parametrize("data", [b"[1,2]", b"[1,2,3,4,5,6]", b"7", b"{", b""])
def test_a_trace_of_another_kind_is_an_error(data: bytes) -> None:
    with pytest.raises(ValueError, match="not a trace"):
        Trace.unpack(data)
