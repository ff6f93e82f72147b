"""What stands in the audit log: old beside new, who was refused, what happened elsewhere."""

import json
import multiprocessing
import shutil
from pathlib import Path

import pytest
from browser.scene import TOKENS
from web_world import AWAY, NONE, Newest, World

from motionserver.cli.audit_verify import verify_text
from motionserver.settings.config import load_config
from motionserver.settings.resolve import resolve
from motionserver.web.app import build_app
from motionserver.web.audit import Audit
from motionserver.web.audit_chain import rotated
from motionserver.web.auth import Caller, Role
from motionserver.web.refusals import Budget
from motionserver.web.snapshot import StatusBoard
from motionserver.web.watch import Watch

CALLER = Caller(Role.TUNER, "0badcafe", "127.0.0.1")


@pytest.fixture
def world(tmp_path):
    return World(tmp_path)


def lines(path: Path):
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def last(world):
    return lines(world.config.audit_file)[-1]


def tag(world):
    return {"if-match": f'"{world.scene.book.version}"'}


def test_a_change_of_the_tuning_carries_old_beside_new(world):
    tuner, old = world.client("tuner"), world.scene.book.model.scale
    same = world.scene.book.model.horizon_s
    sent = {"scale": 0.4, "horizon_s": same}
    assert tuner.patch("/api/tuning", json=sent, headers=tag(world)).status_code == 200
    assert last(world)["changes"] == {"scale": {"old": old, "new": 0.4}}
    assert tuner.post("/api/tuning/undo", headers=tag(world)).status_code == 200
    assert last(world)["changes"] == {"scale": {"old": 0.4, "new": old}}


def test_a_change_that_was_refused_tells_what_was_asked_and_changes_nothing(world):
    tuner = world.client("tuner")
    answer = tuner.patch("/api/tuning", json={"scale": 0.4}, headers={"if-match": '"99"'})
    assert answer.status_code == 412
    assert (last(world)["result"], last(world)["asked"]) == ("stale", {"scale": 0.4})
    assert "changes" not in last(world)
    assert tuner.post("/api/tuning/undo", headers=tag(world)).status_code == 409
    assert "changes" not in last(world)


def test_a_preset_that_is_saved_carries_what_it_replaced(world):
    tuner = world.client("tuner")
    for scale in (0.4, 0.7):
        assert tuner.put("/api/presets/mine", json={"scale": scale}).status_code == 201
    first, second = lines(world.config.audit_file)
    assert first["changes"]["scale"] == {"old": None, "new": 0.4}
    assert second["changes"] == {"scale": {"old": 0.4, "new": 0.7}}


def test_operators_are_written_down_and_who_may_not(world):
    operator, viewer = world.client("operator"), world.client("viewer")
    operator.post("/api/engage")
    operator.post("/api/park")
    operator.post("/api/reset")
    viewer.post("/api/engage")
    world.client(peer=AWAY, authorization="Bearer " + "x" * 43).get("/api/status")
    world.client(peer=AWAY).post(f"/api/{TOKENS['operator']}")
    world.client("operator", origin="https://evil.example").post("/api/engage")
    told = [
        (one["action"], one["role"], one["result"], one.get("path"))
        for one in lines(world.config.audit_file)
    ]
    assert told == [
        ("engage", "operator", "done", None),
        ("park", "operator", "done", None),
        ("reset", "operator", "reset is not possible in PARKING", None),
        ("refused", "viewer", "403 the role viewer may not do this", "/api/engage"),
        ("refused", "none", "401 the token is not known here", "/api/status"),
        ("refused", "none", "401 a token is needed", "?"),
        ("refused", "none", "403 Origin says that another site sent this", "/api/engage"),
    ]
    assert lines(world.config.audit_file)[4]["address"] == AWAY[0]


def test_refusals_cannot_push_out_what_was_done(world):
    world.client("operator").post("/api/engage")
    stranger = world.client(peer=AWAY)
    for _ in range(300):
        stranger.post("/api/engage")
    assert len(lines(world.config.audit_file)) == 11


def test_a_budget_gives_a_few_then_one_now_and_then_and_counts_the_rest():
    time = 0.0
    budget = Budget(3, 60.0, lambda: time)
    assert [budget.take() for _ in range(5)] == [0, 0, 0, None, None]
    time = 59.0
    assert budget.take() is None
    time = 60.0
    assert [budget.take(), budget.take()] == [3, None]
    time = 1e6
    assert [budget.take() for _ in range(4)] == [1, 0, 0, None]


class Seen:
    """A board whose status the test makes up."""

    def __init__(self, world, most=1000):
        self.guard = {"pid": 10, "t_ns": 0, "state": "PARKED", "events": []}
        self.planner = {"pid": 11, "t_ns": 0, "source": {"address": None}}
        self.now = 0
        board = StatusBoard(
            Newest(lambda: self.guard), Newest(lambda: self.planner), NONE, world.config, self.clock
        )
        self.path = world.config.audit_file
        self.watch = Watch(board, Audit(self.path), lambda: self.now * 1e-9)
        self.watch.look()

    def clock(self):
        self.now += 10**9
        self.guard["t_ns"] = self.now
        return self.now

    def event(self, text):
        self.guard["events"] = [*self.guard["events"], {"t_ns": self.now + 1, "text": text}][-20:]

    def look(self):
        before = len(lines(self.path))
        self.watch.look()
        return lines(self.path)[before:]


def test_what_an_operator_does_at_the_console_is_written_down(world):
    seen = Seen(world)
    seen.event("PARKED -> RAISING: an operator engaged")
    assert [one["text"] for one in seen.look()] == ["PARKED -> RAISING: an operator engaged"]
    assert seen.look() == []
    for text in ("READY -> RUN: source is fresh", "RUN -> HOLD: stale", "HOLD -> RUN: fresh"):
        seen.event(text)
        assert seen.look() == []
    seen.event("FAULT -> PARKED: an operator reset, the device is down")
    assert len(seen.look()) == 1


def test_another_client_and_another_guard_are_written_down(world):
    seen = Seen(world)
    seen.planner["source"] = {"kind": "native", "address": "192.0.2.1:5", "session": 7}
    (line,) = seen.look()
    assert (line["action"], line["old"]) == ("client takeover", None)
    assert line["new"] == {"kind": "native", "address": "192.0.2.1:5", "session": 7}
    assert seen.look() == []
    seen.planner["source"] = {"kind": "native", "address": "192.0.2.9:5", "session": 8}
    (line,) = seen.look()
    assert (line["old"]["session"], line["new"]["session"]) == (7, 8)
    seen.guard |= {"pid": 12, "state": "RUN"}
    (line,) = seen.look()
    assert (line["action"], line["old"], line["new"], line["state"]) == (
        *("guard takeover", 10, 12),
        "RUN",
    )


def test_clients_that_take_turns_cannot_fill_the_log(world):
    seen = Seen(world)
    for session in range(500):
        seen.planner["source"] = {"kind": "native", "address": "192.0.2.1:5", "session": session}
        seen.look()
    assert len(lines(seen.path)) < 60


def test_the_page_watches_while_it_serves(world):
    guard = world.scene.guard()
    app = build_app(
        world.config, Newest(lambda: guard), Newest(world.scene.planner), NONE, dict, dict
    )
    from starlette.testclient import TestClient

    with TestClient(app, base_url="http://127.0.0.1:8080") as client:
        assert client.get("/healthz").status_code == 200
    assert [one["action"] for one in lines(world.config.audit_file)] == ["client takeover"]


def test_the_log_outlives_the_run_directory_and_is_found_there(tmp_path):
    state = tmp_path / "state"
    config = tmp_path / "server.toml"
    config.write_text(f'[server]\nrun_dir = "{tmp_path / "run"}"\nstate_dir = "{state}"\n')
    file = Path(resolve(load_config(config), tmp_path / "run")["web"]["audit_file"])
    (tmp_path / "run").mkdir()
    file.parent.mkdir(exist_ok=True)
    Audit(file).note("engage", CALLER, "done")
    shutil.rmtree(tmp_path / "run")
    text, is_whole = verify_text(None, config, "")
    assert is_whole
    assert f"{state / 'audit.jsonl'}: 1 lines" in text


def test_a_chain_of_all_kinds_of_lines_is_whole_over_rotations(tmp_path, world):
    path = tmp_path / "audit.jsonl"
    audit = Audit(path, 3000)
    for number in range(40):
        audit.note("tune", CALLER, "done", changes={"scale": {"old": number, "new": number + 1}})
        audit.write({"action": "client takeover", "old": None, "new": {"address": "\u2028\x00"}})
    assert rotated(path).exists()
    text, is_whole = verify_text(path, None, "")
    assert is_whole, text
    files = (path, rotated(path))
    assert sum(file.stat().st_size for file in files) < 2 * 3500
    data = rotated(path).read_bytes()
    rotated(path).write_bytes(data.replace(b'"old":', b'"0ld":', 1))
    assert not verify_text(path, None, "")[1]


def test_a_writer_sees_what_another_wrote_and_put_aside(tmp_path):
    path = tmp_path / "audit.jsonl"
    writers = [Audit(path, 2000) for _ in range(3)]
    for number in range(60):
        writers[number % 3].write({"action": "tune", "number": number})
        text, is_whole = verify_text(path, None, "")
        assert is_whole, text
    assert rotated(path).exists()
    assert [one.lost for one in writers] == [0, 0, 0]


def write_many(path, who):
    audit = Audit(path, 4000)
    for number in range(60):
        audit.write({"action": "tune", "who": who, "number": number})
    return audit.lost


def test_two_servers_of_one_state_directory_write_one_chain(tmp_path):
    path = tmp_path / "audit.jsonl"
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        lost = pool.starmap(write_many, [(path, 1), (path, 2)])
    text, is_whole = verify_text(path, None, "")
    assert is_whole, text
    kept = lines(path) + lines(rotated(path))
    assert kept
    assert sum(lost) < 60


def test_a_writer_that_holds_the_lock_costs_lines_and_no_time(tmp_path):
    import fcntl

    path = tmp_path / "audit.jsonl"
    audit = Audit(path)
    with path.with_name("audit.jsonl.lock").open("ab") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        audit.note("park", CALLER, "done")
    assert audit.lost == 1
    audit.note("park", CALLER, "done")
    assert len(lines(path)) == 1


def test_a_fallback_of_the_tuning_is_written_down_once(world):
    seen = Seen(world)
    assert seen.look() == []
    seen.planner["tuning"] = {"version": 8, "fallback": "Version 7 of the tuning cannot be used."}
    (line,) = seen.look()
    assert (line["action"], line["version"]) == ("tuning fallback", 8)
    assert "Version 7" in line["text"]
    assert seen.look() == []
    seen.planner["tuning"] = {"version": 9, "fallback": ""}
    assert seen.look() == []
