import asyncio
import hashlib
import hmac
import json
import os
import re
import stat
import tomllib
from importlib.resources import files

import pytest
from browser.scene import t2_compact, write_configuration

from motionserver.web.audit import Audit
from motionserver.web.auth import Caller
from motionserver.web.config import WebConfig, WebConfigError, read_config
from motionserver.web.main import main
from motionserver.web.refusal import Refusal
from motionserver.web.snapshot import StatusBoard
from motionserver.web.stream import MOST_OF_ONE, MOST_READERS, Streams
from motionserver.web.tokens import Role, Tokens, load_tokens

STATIC = files("motionserver.web").joinpath("static")


def config(folder, **more):
    values = {"host": "127.0.0.1", "port": 0, "tokens_file": folder / "t.json", **more}
    paths = {"run_dir": folder, "audit_file": folder / "a", "presets_dir": folder / "p"}
    return WebConfig(machine={}, **paths, **values)


class Counted:
    def __init__(self):
        self.reads = 0

    def read(self):
        self.reads += 1
        return {"t_ns": 0, "state": "RUN"}


class Clock:
    def __init__(self):
        self.ns = 1_000_000_000

    def __call__(self):
        return self.ns


def test_status_is_computed_once_per_50_ms_for_all_readers(tmp_path):
    guard, clock = Counted(), Clock()
    board = StatusBoard(guard, Counted(), Counted(), config(tmp_path), clock)
    texts = {board.current().text for _ in range(100)}
    assert (len(texts), guard.reads) == (1, 1)
    clock.ns += 49_000_000
    board.current()
    assert guard.reads == 1
    clock.ns += 1_000_000
    board.current()
    assert guard.reads == 2


class Broken:
    def read(self):
        raise ValueError("half written")


def test_an_unreadable_snapshot_is_as_good_as_none(tmp_path):
    board = StatusBoard(Broken(), Broken(), Broken(), config(tmp_path), Clock())
    assert board.current().data["state"] == "UNKNOWN"


async def nothing(*_):
    await asyncio.sleep(0)
    return {"type": "http.disconnect"}


async def test_streams_are_bounded_and_counted_before_they_begin(tmp_path):
    streams = Streams(StatusBoard(Counted(), Counted(), Counted(), config(tmp_path), Clock()))
    places = ["a"] * MOST_OF_ONE + ["b"] * (MOST_READERS - MOST_OF_ONE)
    opened = [streams.open("/api/stream", place) for place in places]
    assert streams.readers == MOST_READERS
    for place in "abc":
        with pytest.raises(Refusal) as caught:
            streams.open("/api/stream", place)
        assert caught.value.status == 503
    body = opened[0].body_iterator
    assert await anext(body) == b"retry: 1000\n\n"
    event = await anext(body)
    assert json.loads(event.removeprefix(b"data: "))["state"] == "UNKNOWN"
    await body.aclose()
    for stream in opened[1:]:
        await stream({"type": "http", "asgi": {"spec_version": "2.3"}}, nothing, nothing)
    assert streams.readers == 1
    with pytest.raises(RuntimeError):
        await opened[0]({"type": "http", "asgi": {"spec_version": "2.3"}}, nothing, broken)
    assert streams.readers == 0


async def broken(*_):
    raise RuntimeError("the connection went")


async def test_one_address_cannot_take_all_streams(tmp_path):
    streams = Streams(StatusBoard(Counted(), Counted(), Counted(), config(tmp_path), Clock()))
    opened = [streams.open("/api/stream", "a") for _ in range(MOST_OF_ONE)]
    with pytest.raises(Refusal):
        streams.open("/api/stream", "a")
    opened.append(streams.open("/api/stream", "b"))
    for stream in opened:
        await stream({"type": "http", "asgi": {"spec_version": "2.3"}}, nothing, nothing)


def test_tokens_are_made_once_private_and_different(tmp_path):
    path = tmp_path / "deep" / "tokens.json"
    load_tokens(path)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    made = json.loads(path.read_text())
    assert len(set(made.values())) == 3
    assert min(map(len, made.values())) >= 43
    tokens = load_tokens(path)
    for role in Role:
        found = tokens.role_of(made[role.name.lower()])
        assert found is not None
        assert found[0] is role
    assert tokens.role_of("") is None
    assert made["operator"] not in repr(vars(tokens))


@pytest.mark.parametrize(
    ("text", "mode"),
    [
        ('{"viewer": "a", "tuner": "b", "operator": "c"}', 0o600),
        (json.dumps(dict.fromkeys(("viewer", "tuner", "operator"), "x" * 40)), 0o600),
        ("{}", 0o600),
        (
            json.dumps({"viewer": "v" * 40, "tuner": "t" * 40, "operator": "sha256:" + "0" * 63}),
            0o600,
        ),
        ("[" * 4000, 0o600),
        ("nonsense", 0o600),
        (json.dumps({"viewer": "v" * 40, "tuner": "t" * 40, "operator": "o" * 40}), 0o640),
    ],
)
def test_unsafe_token_files_are_refused(tmp_path, text, mode):
    path = tmp_path / "tokens.json"
    path.write_text(text)
    path.chmod(mode)
    with pytest.raises(WebConfigError) as caught:
        load_tokens(path)
    assert text not in str(caught.value)


def test_open_binds_need_certificate_key_and_tokens(tmp_path):
    pem = tmp_path / "x.pem"
    pem.touch(0o640)
    config(tmp_path).check()
    config(tmp_path, host="::1").check()
    for host in ("0.0.0.0", "::", "192.0.2.4", "simulator.example"):
        with pytest.raises(WebConfigError):
            config(tmp_path, host=host).check()
        with pytest.raises(WebConfigError):
            config(tmp_path, host=host, tls_cert=pem, tls_key=pem).check()
    (tmp_path / "t.json").touch()
    config(tmp_path, host="192.0.2.4", tls_cert=pem, tls_key=pem).check()
    with pytest.raises(WebConfigError):
        config(tmp_path, tls_cert=pem).check()
    pem.chmod(0o644)
    with pytest.raises(WebConfigError, match="chmod o-rwx"):
        config(tmp_path, tls_cert=pem, tls_key=pem).check()


def test_tokens_may_be_kept_as_hashes(tmp_path):
    path = tmp_path / "tokens.json"
    plain = {role: role.name.lower() * 9 for role in Role}
    hashed = {role: "sha256:" + hashlib.sha256(t.encode()).hexdigest() for role, t in plain.items()}
    path.write_text(json.dumps({role.name.lower(): hashed[role] for role in Role}))
    path.chmod(0o400)
    tokens = load_tokens(path)
    for role in Role:
        assert tokens.role_of(plain[role]) == (role, hashed[role][7:15])
        assert tokens.role_of(hashed[role]) is None


def test_each_token_is_compared_whatever_was_found(monkeypatch):
    compared = []
    real = hmac.compare_digest
    monkeypatch.setattr(hmac, "compare_digest", lambda a, b: compared.append((a, b)) or real(a, b))
    tokens = Tokens({role: hashlib.sha256(role.name.encode()).digest() for role in Role})
    for given in ("VIEWER", "TUNER", "OPERATOR", "nobody", ""):
        compared.clear()
        tokens.role_of(given)
        assert len(compared) == len(Role)
        assert {len(a) for pair in compared for a in pair} == {32}


def test_a_tokens_file_of_somebody_else_is_refused(tmp_path, monkeypatch):
    load_tokens(tmp_path / "t.json")
    monkeypatch.setattr(os, "getuid", lambda: 4711)
    if (tmp_path / "t.json").stat().st_uid == 0:  # root may change every file anyway
        load_tokens(tmp_path / "t.json")
        os.chown(tmp_path / "t.json", 4712, -1)
    with pytest.raises(WebConfigError, match="chown 4711"):
        load_tokens(tmp_path / "t.json")


def test_only_loopback_answers_to_loopback_names(tmp_path):
    assert "localhost" in config(tmp_path).host_names
    names = config(tmp_path, host="192.0.2.4", allowed_hosts=("Sim.Example",)).host_names
    assert names == {"192.0.2.4", "sim.example"}


def test_configuration_is_read_and_mistakes_are_named(tmp_path, capsys):
    path = write_configuration(tmp_path, 8080, t2_compact())
    assert read_config(path).hexapod().name == "t2-compact"
    path.write_text('{"host": "127.0.0.1", "prot": 1}')
    assert main([str(path)]) == 2
    assert "prot" in capsys.readouterr().err
    assert main([]) == 2


def test_audit_lines_are_chained_over_a_restart(tmp_path):
    path = tmp_path / "audit.jsonl"
    caller = Caller(Role.TUNER, "0badcafe", "127.0.0.1")
    for scale in (0.1, 0.2):
        Audit(path).note("tune", caller, "done", changes={"scale": scale})
    first, second = path.read_text().splitlines()
    assert json.loads(second)["previous"] == hashlib.sha256(first.encode()).hexdigest()
    lost = Audit(tmp_path / "no" / "such" / "dir")
    lost.note("tune", caller, "done")
    assert lost.lost == 1


def test_vendored_files_are_what_the_list_says():
    listed = tomllib.loads(STATIC.joinpath("vendor/VENDOR.toml").read_text())
    found = set()
    for library in listed.values():
        for name, digest in library["sha256"].items():
            data = STATIC.joinpath("vendor").joinpath(name).read_bytes()
            assert hashlib.sha256(data).hexdigest() == digest, name
            found.add(name)
    folder = STATIC.joinpath("vendor/uplot")
    assert {f"uplot/{item.name}" for item in folder.iterdir()} == found


def test_the_page_needs_no_other_site_and_no_inline_code():
    texts = {
        i.name: i.read_text() for i in STATIC.iterdir() if i.name.endswith((".js", ".html", ".css"))
    }
    assert {"index.html", "app.js", "style.css"} <= set(texts)
    for name, text in texts.items():
        assert not re.search(
            r"https?://|innerHTML|insertAdjacentHTML|document\.write|eval\(", text
        ), name
    assert not re.search(r"<script(?![^>]*src=)|\son\w+=|style=", texts["index.html"])
