"""Real processes: a fault makes a dump that agrees with the base's log; a disk may refuse it."""

import csv
import json
import os
import signal
import struct
from pathlib import Path

import pytest
from motion_clients.moog_wire import Mcw
from motion_clients.motion_log import read_motion_log
from rig import Rig, assert_soft, cli, until

from motionserver.telemetry.blackbox.dump import dumps
from motionserver.telemetry.blackbox.reader import read_dump, table
from motionserver.telemetry.mapped import MappedFile

OFFSET = 0.9022
"""What a LENGTH word leaves out of a leg of t2-compact [m]."""


def folder(rig: Rig) -> Path:
    return rig.folder / "state" / "blackbox"


def wait_dump(rig: Rig, count: int = 1) -> Path:
    rig.wait_for(lambda: len(dumps(folder(rig))) >= count, f"{count} dumps")
    return dumps(folder(rig))[-1]


def dump_about(rig: Rig, text: str) -> dict | None:
    """The dump that has this among its reasons."""
    found = [read_dump(dump) for dump in dumps(folder(rig))]
    return next((d for d in found if text in [one["text"] for one in d["reasons"]]), None)


def told(rig: Rig) -> dict:
    path = rig.run_dir / "blackbox.map"
    message = MappedFile(path).read() if path.exists() else None
    return {} if message is None else json.loads(message[1])


def test_a_silent_base_makes_a_dump_that_agrees_with_what_the_base_received(tmp_path):
    with Rig(tmp_path) as rig:
        rig.run()
        rig.wait_plans(60)
        rig.base.pull_cable()
        rig.wait_state("FAULT")
        dump = wait_dump(rig)
        assert rig.end() == 3
        rig.verdict()
    assert "-fault-no-feedback-from-the-device" in dump.name
    assert dump.stat().st_mode & 0o777 == 0o600
    data = read_dump(dump)
    states = [(e["before"], e["state"]) for e in data["guard_events"] if e["what"] == "state"]
    assert states[-2:] == [("READY", "RUN"), ("RUN", "FAULT")]
    assert [e["op"] for e in data["guard_events"] if e["what"] == "request"][-1] == "engage"
    assert data["config"]["sources"][0]["key"] == ""
    # every position the base was given until the fault is in the dump, word for word, in order
    fault_ns = data["reasons"][0]["t_ns"]
    received = [
        (at, struct.unpack(">I6fI", words)) for at, words in read_motion_log(tmp_path / "base.log")
    ]
    given = [
        words[1:7]
        for at, words in received
        if at < fault_ns and words[0] & 0xFF == Mcw.NEW_POSITION
    ]
    rows = [row for row in table(data, "guard_rows") if row["is_sent"] and row["order"] == "follow"]
    sent = [tuple(row[f"leg_m_{n}"] - OFFSET for n in range(1, 7)) for row in rows]
    assert len(sent) >= len(given) > 60
    for ours, theirs in zip(sent, given, strict=False):
        # a word is a float of 24 bits
        assert ours == pytest.approx(theirs, abs=2e-8)
    # the dump goes on for a moment after the fault
    assert data["made_ns"] - fault_ns >= 1e9
    verdicts = [row for row in table(data, "guard_rows") if row["verdict"] == "accepted"]
    assert len(verdicts) >= 60
    assert {p["plan_id"] for p in data["accepted"]} & {row["proposal_id"] for row in verdicts}
    packets = table(data, "packets")
    assert len(packets) > 30
    assert {p["mode"] for p in packets} == {"drive"}
    assert len(data["periods"]) > 60

    shown = cli("blackbox", "show", "--config", str(rig.config), "--csv", str(tmp_path / "s.csv"))
    assert shown.returncode == 0, shown.stderr
    print(shown.stdout)
    for text in (
        "RUN -> FAULT (played to rest, then stood, until a reset): no feedback from the device",
        "operator: engage by console, granted",
        "to the platform",
        "accepted; ",
        "plans_accepted",
    ):
        assert text in shown.stdout
    with (tmp_path / "s.csv").open(newline="") as stream:
        samples = list(csv.DictReader(stream))
    assert len(samples) == len(data["guard_rows"]["rows"])
    assert float(samples[-1]["leg_m_1"]) == table(data, "guard_rows")[-1]["leg_m_1"]
    assert any(sample["packet_sequence"] not in ("", "-1") for sample in samples)
    assert any(sample["wanted_x_m_s2"] for sample in samples)
    listed = cli("blackbox", "list", "--config", str(rig.config))
    assert dump.name in listed.stdout
    assert "FAULT: no feedback" in listed.stdout


def test_killed_processes_are_written_down_and_the_motion_goes_on(tmp_path):
    with Rig(tmp_path, web=True) as rig:
        rig.run()
        rig.wait_for(lambda: rig.pid("web"), "the page")
        web = rig.pid("web")
        os.kill(web, signal.SIGKILL)
        first = wait_dump(rig)
        assert rig.state == "RUN"
        text = f"the web, process {web}, was killed by SIGKILL"
        assert read_dump(first)["reasons"][0]["text"] == text
        # a black box that is killed goes on with what the histories hold
        before = table(read_dump(first), "guard_rows")[0]["t_ns"]
        box = rig.pid("blackbox")
        os.kill(box, signal.SIGKILL)
        rig.wait_for(lambda: rig.pid("blackbox") not in (None, box), "another black box")
        guard = rig.pid("guard")
        os.kill(guard, signal.SIGKILL)
        text = f"the guard, process {guard}, was killed by SIGKILL"
        data = rig.wait_for(lambda: dump_about(rig, text), "the guard's dump")
        assert table(data, "guard_rows")[0]["t_ns"] == before
        assert [e for e in data["guard_events"] if e["what"] == "guard"][1:]
        rig.wait_state("PARKED", "FAULT")
        # the service's own death is written down once the guard has parked
        count = len(dumps(folder(rig)))
        assert (room := (rig.run_dir / "blackbox").resolve()).is_dir()
        os.kill(rig.server.pid, signal.SIGKILL)
        rig.server.wait(10.0)
        until(lambda: not rig.leftovers(), "all children to end")
        assert len(dumps(folder(rig))) == count + 1
        assert dump_about(rig, "the service died")
        assert room.parent == rig.run_dir or not room.exists()
        assert rig.verdict()["violations"] == 0


def test_a_folder_that_cannot_be_written_costs_the_dump_and_nothing_else(tmp_path):
    (tmp_path / "state").mkdir()
    (tmp_path / "state" / "blackbox").write_text("a file where the folder should be")
    with Rig(tmp_path, web=True) as rig:
        rig.run()
        rig.wait_for(lambda: rig.pid("web"), "the page")
        late = rig.shown()["counters"].get("missed_slots", 0)
        os.kill(rig.pid("web"), signal.SIGKILL)
        rig.wait_for(lambda: told(rig).get("failed"), "a dump that failed")
        assert "blackbox" in told(rig)["error"]
        rig.wait_plans(30)
        assert rig.state == "RUN"
        assert rig.shown()["counters"]["entered_run"] == 1
        assert "blackbox_errors" not in rig.shown()["counters"]
        listed = cli("blackbox", "list", "--config", str(rig.config))
        assert "1 dumps could not be written" in listed.stdout, (late, listed.stdout)
        assert rig.end() == 0
        verdict = rig.verdict()
    assert_soft(verdict)
