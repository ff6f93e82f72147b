"""What `motionserver record` writes is read by evaluate, tune, tune --predictor and replay."""

import csv
import json
import socket

import numpy as np
import pytest
from motion_clients import recording_path
from motion_protocol import decode_cue
from own_hexapod import RECORDINGS
from typer.testing import CliRunner

from motionserver.cli import devices, judging
from motionserver.core.limits import machine_to_mapping
from motionserver.core.state import DriveMode
from motionserver.cueing.tuning import Tuning
from motionserver.errors import ConfigError
from motionserver.evaluate.drive import wanted_at
from motionserver.evaluate.lockstep import drive
from motionserver.evaluate.options import EvaluateOptions
from motionserver.evaluate.recording import RecordingError, read_recording
from motionserver.settings.machine import load_machine
from motionserver.settings.tuning import TuningModel

MACHINE = load_machine("t2-compact").with_head(np.array([0.0, 0.1, 0.6]))
NAMES = ("t", "ax", "ay", "az", "p", "q", "r", "v", "roll", "pitch")
ARM = [0.2, 0.0, 0.5]
STATES = [(0.0, "PARKED"), (1.0, "RISING"), (2.0, "RUN"), (13.5, "PARKING"), (14.0, "PARKED")]


def settings(**tuning):
    values = {**TuningModel().values(), "algorithm": "classical", "scale": 0.5, **tuning}
    return {
        "machine": machine_to_mapping(MACHINE), "vehicle_head_m": ARM, "budget_s": 0.01,
        "planner_period_s": 0.02, "platform_rate_hz": 50.0, "tuning": values,
    }  # fmt: skip


def write(path, states=STATES, told=((0.0, {}),), modes=None, start=40.0, name="truck_brake_accel"):
    """A file as the server writes it, by hand: platform rows at 50 Hz, packets at 100 Hz."""
    with recording_path(name).open(newline="") as stream:
        drive = [row for row in csv.DictReader(stream) if start <= float(row["t"]) <= start + 15.0]
    lines = [["time_s", "state", "surge_m", *NAMES, "mode", "throttle", "brake", "clutch",
              "steering", "gear", "settings"]]  # fmt: skip
    waiting = [(at, json.dumps(settings(**changes))) for at, changes in told]
    for k, row in enumerate(drive):
        now = 0.01 * k
        if k % 2 == 0:
            state = [name for at, name in states if at <= now + 1e-9][-1]
            text = waiting.pop(0)[1] if waiting and waiting[0][0] <= now else ""
            lines.append([f"{now:.3f}", state, "0.0", *[""] * 16, text])
        mode = "drive" if modes is None else modes(now)
        values = [f"{now + 0.001:.6f}", *(row[n] for n in NAMES[1:])]
        lines.append(["", "", "", *values, mode, "0.5", "0", "0", "0.1", "3", ""])
    with path.open("w", newline="") as stream:
        csv.writer(stream).writerows(lines)
    return path


@pytest.fixture
def live(tmp_path):
    return write(tmp_path / "live.csv")


def test_what_counts_is_the_stretch_in_run_with_all_settings(live):
    read = read_recording(live)
    assert read.duration == pytest.approx(11.49, abs=0.011)
    assert read.live.begin == 2.0
    assert read.live.planner_hz == pytest.approx(50.0)
    assert read.live.machine.head.tolist() == [0.0, 0.1, 0.6]
    assert read.live.tuning["scale"] == 0.5
    assert read.drivers[0].throttle == 0.5
    # at the head: f + w' x r + w x (w x r), by hand from the plain recording
    plain = read_recording(RECORDINGS / "truck_brake_accel.csv").excerpt(42.0, 53.49)
    spin = np.gradient(plain.rates, plain.times, axis=0)
    lever = np.cross(spin, ARM) + np.cross(plain.rates, np.cross(plain.rates, ARM))
    assert read.force[5:-5] == pytest.approx(
        (plain.force + lever)[5 : len(read.force) - 5], abs=1e-3
    )


def test_options_are_as_live_unless_they_are_written(live):
    found = read_recording(live).live
    names, machine, tuning, rate = EvaluateOptions("mpc,classical").for_drive(found)
    assert (names, machine.head.tolist(), rate) == (["classical", "mpc"], [0.0, 0.1, 0.6], 50.0)
    assert (tuning.scale, tuning.tilt_rate) == (0.5, pytest.approx(np.radians(3.0)))
    told = EvaluateOptions(
        "mpc", scale=0.8, planner_hz=100.0, head="0,0,0.7", tilt_rate="6",
        told=frozenset({"algorithm", "platform", "planner_rate"}),
    )  # fmt: skip
    names, machine, tuning, rate = told.for_drive(found)
    assert (names, machine.head.tolist(), rate) == (["mpc"], [0.0, 0.0, 0.7], 100.0)
    assert (tuning.scale, tuning.tilt_rate) == (0.8, pytest.approx(np.radians(6.0)))


def test_a_live_drive_fades_in_and_others_do_not(live):
    read = read_recording(live).excerpt(0.0, 2.0)
    tuning = Tuning(algorithm="classical", scale=0.5)
    faded = drive(MACHINE, read, tuning, rate=100.0, planner_hz=50.0)
    assert faded.periods.force[0] == pytest.approx(0.02 * faded.wanted_force[0], rel=0.05)
    later = read_recording(live).excerpt(1.0, 3.0)
    assert later.live is None
    whole = drive(MACHINE, later, tuning, rate=100.0, planner_hz=50.0)
    assert whole.periods.force[1] == pytest.approx(whole.wanted_force[2], rel=0.05, abs=0.02)


def test_longest_of_several_stretches_and_changed_tunables_are_told(tmp_path):
    states = [(0.0, "RUN"), (3.0, "HOLD"), (4.0, "RUN"), (12.0, "HOLD")]
    told = ((0.0, {}), (2.0, {"scale": 0.4}), (6.0, {"scale": 0.3}))
    read = read_recording(write(tmp_path / "live.csv", states, told))
    assert (read.live.begin, read.live.end) == (4.0, 12.0)
    assert read.live.tuning["scale"] == 0.4
    remarks = " ".join(read.warnings)
    assert "driven in 2 stretches" in remarks
    assert "changed 1 times" in remarks


@pytest.mark.parametrize(
    ("states", "told", "words"),
    [
        ([(0.0, "PARKED")], ((0.0, {}),), "never in RUN.*engage it"),
        (STATES, (), "no settings"),
        ([(14.995, "RUN")], ((0.0, {}),), "never in RUN|nothing was heard"),
    ],
)
def test_what_cannot_be_judged_says_why(tmp_path, states, told, words):
    states = states if states[0][0] == 0.0 else [(0.0, "PARKED"), *states]
    with pytest.raises(RecordingError, match=words):
        read_recording(write(tmp_path / "live.csv", states, told))


def test_nothing_is_wanted_while_the_simulation_pauses(tmp_path):
    pause = lambda now: "pause" if 6.0 < now < 8.0 else "drive"  # noqa: E731
    read = read_recording(write(tmp_path / "live.csv", modes=pause, name="truck_roundabout"))
    assert read.modes[500] is DriveMode.PAUSE
    force, rates = wanted_at(read, np.array([3.0, 5.0]), 1.0, None)
    assert np.abs(force[0]).max() > 0.05
    assert not force[1].any()
    assert not rates[1].any()
    driven = drive(MACHINE, read.excerpt(3.0, 7.0), Tuning(scale=0.5, algorithm="classical"))
    # the cue fades within 0.3 s
    late = (driven.periods.times > 1.4) & (driven.periods.times < 2.9)
    assert np.abs(driven.periods.force[late]).max() < 1e-9


def run(*words):
    done = CliRunner().invoke(judging.app, [str(word) for word in words], catch_exceptions=False)
    return done.exit_code, done.output


def test_four_commands_take_the_file_directly(tmp_path):
    one, two = write(tmp_path / "one.csv"), write(tmp_path / "two.csv", name="truck_roundabout")
    code, text = run("evaluate", one, "--predictions")
    assert code == 0
    assert "vehicle" in text
    code, text = run(
        "tune", one, two, "--algorithm", "classical", "--trials", 2, "--excerpt", 1,
        "--planner-rate", 20, "--out", tmp_path / "tuned",
    )  # fmt: skip
    assert code in (0, 1), text
    assert json.loads((tmp_path / "tuned" / "result.json").read_text())
    code, text = run("tune", one, two, "--predictor", "mine", "--out", tmp_path / "fitted")
    assert code == 0, text
    assert (tmp_path / "fitted" / "mine.json").exists()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as server:
        server.bind(("127.0.0.1", 0))
        lines = one.read_text().splitlines(keepends=True)
        (tmp_path / "short.csv").write_text("".join(lines[:20]))
        port = server.getsockname()[1]
        said = devices.replay(
            str(tmp_path / "short.csv"), f"127.0.0.1:{port}", "native", False, 0.0
        )
        cue = decode_cue(server.recv(2048))
    assert "in 1 rounds" in said
    assert cue.driver.gear == 3
    with pytest.raises(ConfigError, match="INPUT"):
        devices.replay(str(tmp_path / "none.csv"), "127.0.0.1:9", "native", False, 0.0)
