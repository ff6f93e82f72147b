import asyncio
import hashlib
import json
import re
import stat
import tomllib
from importlib.resources import files

import pytest
from browser.scene import t2_compact, write_configuration

from motionserver.web.audit import Audit
from motionserver.web.auth import Caller, Role, load_tokens
from motionserver.web.config import WebConfig, WebConfigError, read_config
from motionserver.web.main import main
from motionserver.web.refusal import Refusal
from motionserver.web.snapshot import StatusBoard
from motionserver.web.stream import MOST_READERS, Streams

STATIC = files("motionserver.web").joinpath("static")


def config(folder, **more):
    values = {"host": "127.0.0.1", "port": 0, "tokens_file": folder / "t.json", **more}
    return WebConfig(run_dir=folder, presets_dir=folder / "p", machine={}, **values)


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


async def test_streams_are_bounded_and_counted(tmp_path):
    streams = Streams(StatusBoard(Counted(), Counted(), Counted(), config(tmp_path), Clock()))
    bodies = [streams.open("/api/stream").body_iterator for _ in range(MOST_READERS)]
    for body in bodies:
        assert await anext(body) == b"retry: 1000\n\n"
    event = await anext(bodies[0])
    assert json.loads(event.removeprefix(b"data: "))["state"] == "UNKNOWN"
    with pytest.raises(Refusal) as caught:
        streams.open("/api/stream")
    assert caught.value.status == 503
    for body in bodies:
        await body.aclose()
    assert streams.readers == 0
    await asyncio.sleep(0)


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
        ("nonsense", 0o600),
        (json.dumps({"viewer": "v" * 40, "tuner": "t" * 40, "operator": "o" * 40}), 0o640),
    ],
)
def test_unsafe_token_files_are_refused(tmp_path, text, mode):
    path = tmp_path / "tokens.json"
    path.write_text(text)
    path.chmod(mode)
    with pytest.raises(WebConfigError):
        load_tokens(path)


def test_open_binds_need_certificate_key_and_tokens(tmp_path):
    pem = tmp_path / "x.pem"
    pem.touch()
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
