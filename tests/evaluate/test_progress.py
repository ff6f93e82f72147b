"""Progress and the time left are visible all the time, on a terminal and in a file."""

import io
import re

from own_hexapod import RECORDINGS

from motionserver.cueing.tuning import Tuning
from motionserver.evaluate import command, predictions
from motionserver.evaluate.drive import no_motion
from motionserver.evaluate.hindsight import Hindsight
from motionserver.evaluate.progress import Progress, spoken
from motionserver.evaluate.recording import read_recording
from motionserver.evaluate.screen import Washout
from motionserver.evaluate.yardstick import Yardstick
from motionserver.settings.machine import load_machine


class Terminal(io.StringIO):
    def isatty(self):
        return True


class Clock:
    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


def told(stream, steps, total=100.0):
    clock = Clock()
    progress = Progress("work", total, stream, clock)
    for instant, done in steps:
        clock.now = instant
        progress.at(done, "a")
    return progress, clock


def test_time_left_is_told_from_the_first_second_on_and_every_ten():
    stream = io.StringIO()
    told(stream, [(0.1 * k, 0.1 * k) for k in range(301)])
    lines = stream.getvalue().splitlines()
    assert lines[0] == "work: 0 % done, time left is being measured: a"
    assert lines[1] == "work: 1 % done, about 1 min 39 s left: a"
    assert [re.search(r"(\d+) %", line).group(1) for line in lines] == ["0", "1", "11", "21"]
    assert lines[-1].endswith("about 1 min 19 s left: a")


def test_a_part_that_tells_nothing_for_long_lets_the_time_run_down():
    stream = io.StringIO()
    told(stream, [(0.0, 0.0), (10.0, 50.0), (20.0, 50.0), (31.0, 50.0)])
    assert [line.partition("done, ")[2] for line in stream.getvalue().splitlines()] == [
        "time left is being measured: a",
        "about 10 s left: a",
        "about 0 s left: a",
        "about 0 s left: a",
    ]


def test_a_terminal_has_one_line_that_lasting_lines_push_away():
    stream = Terminal()
    progress, _ = told(stream, [(0.2 * k, 2.0 * k) for k in range(11)])
    assert stream.getvalue().count("\n") == 0
    assert stream.getvalue().count("\r") >= 4
    progress.line("mpc: done")
    last = stream.getvalue().rsplit("\r", 1)[1]
    assert last == "work: mpc: done\n"


def test_quiet_is_quiet_and_durations_are_for_people():
    stream = io.StringIO()
    Progress("work", 1.0, stream, quiet=True).at(0.5)
    assert stream.getvalue() == ""
    assert [spoken(s) for s in (0.4, 59.4, 60.0, 3599.0, 7260.0)] == [
        "0 s", "59 s", "1 min 00 s", "59 min 59 s", "2 h 01 min",
    ]  # fmt: skip


def test_evaluation_tells_before_the_rivals_are_driven(tmp_path, capsys, monkeypatch):
    lines = (RECORDINGS / "truck_brake_accel.csv").read_text().splitlines()
    path = tmp_path / "piece.csv"
    path.write_text("\n".join(lines[:40]))
    machine = load_machine("t2-compact")
    still = no_motion(machine, read_recording(path), 0.6)
    seen = []

    def rival(found):
        def search(*_, progress, **__):
            seen.append(capsys.readouterr().err)
            progress(0.5)
            return found

        return search

    monkeypatch.setattr(command, "find_yardstick", rival(Yardstick(1.0, still, ())))
    none = Hindsight(Washout(1.0, 1.0, 1.0), False, still, (), (), None)
    monkeypatch.setattr(command, "find_hindsight", rival(none))
    command.evaluate(path, ["classical"], machine, tuning=Tuning(scale=0.6))
    assert "piece: 0 % done" in seen[0]
    assert "classical" in seen[0]
    assert "warning: column t: only 0.38 s long" in seen[0]


def test_predictions_tell_model_and_share():
    heard = []
    recording = read_recording(RECORDINGS / "truck_brake_accel.csv").excerpt(0.0, 5.0)
    predictions.predictions(
        recording, ("constant", "ar"), progress=lambda model, share: heard.append((model, share))
    )
    assert heard[0] == ("constant", 0.0)
    assert [share for _, share in heard] == sorted(share for _, share in heard)
    assert {model for model, _ in heard} == {"constant", "ar"}
