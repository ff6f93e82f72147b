"""The real process under strangers: nothing secret is written, floods do not fill log or places."""

import json
import threading

import pytest
from browser.scene import TOKENS
from web_process import Process

OPERATOR = f"Bearer {TOKENS['operator']}"
BAD = [
    b"\x16\x03\x01\x02\x00\x01\x00",
    b"GET / HTTP/9.9\r\n\r\n",
    b"BREW / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: x\r\n\r\n",
    b"GET /" + b"a" * 20000,
    b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n" + b"X-Y: z\r\n" * 4000,
    b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 1\r\nContent-Length: 2\r\n\r\n",
    b"POST /api/park HTTP/1.1\r\nHost: 127.0.0.1\r\nTransfer-Encoding: chunked\r\n"
    b"Content-Length: 3\r\n\r\n0\r\n\r\n",
    b"GET /api/status HTTP/1.1\r\nHost: 127.0.0.1\r\nAuthorization: Bearer "
    + TOKENS["operator"].encode() + b"\x00\r\n\r\n",
    b"GET /api/stream HTTP/1.1\r\nHost: 127.0.0.1\r\nOrigin: http://evil.example\r\n"
    b"Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
    b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n",
]  # fmt: skip


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    with Process(tmp_path_factory.mktemp("process")) as process:
        yield process


def first_line(site, sent):
    with site.connect() as link:
        link.sendall(sent)
        try:
            return link.makefile("rb").readline()
        except ConnectionResetError:
            return b""


def statuses(site, number, **headers):
    return {site.status("GET", "/api/status", **headers) for _ in range(number)}


@pytest.mark.parametrize("sent", BAD)
def test_what_is_no_request_is_answered_with_no(site, sent):
    line = first_line(site, sent)
    assert line == b"" or line.split()[1] in (b"400", b"401", b"403", b"413"), line
    assert site.status("GET", "/healthz") == 200


def test_client_that_leaves_in_mid_body_leaves_no_traceback(site):
    for announced in (b"Content-Length: 100", b"Transfer-Encoding: chunked"):
        part = b"{" if b"Length" in announced else b"1\r\n{\r\n"
        for method, path in ((b"PATCH", b"/api/tuning"), (b"POST", b"/api/side")):
            with site.connect() as link:
                link.sendall(
                    method + b" " + path + b" HTTP/1.1\r\nHost: 127.0.0.1\r\n"
                    b"Authorization: " + OPERATOR.encode() + b'\r\nIf-Match: "1"\r\n'
                    b"Content-Type: application/json\r\n" + announced + b"\r\n\r\n" + part
                )
    assert site.status("GET", "/healthz") == 200
    with site.ask("GET", "/metrics", authorization=OPERATOR) as answer:
        answer.read()
    assert "Traceback" not in site.written()
    assert "ClientDisconnect" not in site.written()


def test_an_upgrade_to_a_websocket_is_not_one(site):
    own = f"127.0.0.1:{site.port}".encode()
    line = first_line(site, BAD[-1].replace(b"http://evil.example", b"http://" + own).replace(
        b"Host: 127.0.0.1", b"Host: " + own))  # fmt: skip
    assert b"101" not in line


def test_streams_end_at_their_number_and_begin_again(site):
    held = []
    try:
        for _ in range(40):
            context = site.ask("GET", "/api/stream", Authorization=OPERATOR)
            answer = context.__enter__()
            held.append(context)
            if answer.status == 503:
                break
        assert len(held) == 17
        assert site.status("POST", "/api/park", Authorization=OPERATOR) == 200
    finally:
        for context in held:
            context.__exit__(None, None, None)
    pause = threading.Event()
    for _ in range(400):
        with site.ask("GET", "/api/stream", Authorization=OPERATOR) as answer:
            if answer.status == 200:
                return
        pause.wait(0.05)
    raise AssertionError("the places did not come back")


def test_parking_works_beside_a_crowd_of_idle_connections(site):
    crowd = [site.connect() for _ in range(150)]
    try:
        assert site.status("POST", "/api/park", Authorization=OPERATOR) == 200
    finally:
        for link in crowd:
            link.close()


def test_nothing_secret_is_told_or_written(site):
    secrets = [*TOKENS.values(), "a-wrong-token-somebody-typed"]
    told = b""
    for path in ("/api/status", "/api/tuning", "/api/presets", "/metrics", "/", "/static/app.js"):
        with site.ask("GET", path, Authorization=OPERATOR) as answer:
            told += answer.read()
    for path in (f"/api/{secrets[-1]}", f"/api/status?token={secrets[-1]}"):
        with site.ask("GET", path, Authorization=f"Bearer {secrets[-1]}") as answer:
            assert answer.status == 401
            told += answer.read().replace(f"/api/{secrets[-1]}".encode(), b"")
    assert site.status("POST", "/api/park", Authorization=OPERATOR) == 200
    big = json.dumps({"scale": TOKENS["operator"]})
    headers = {"Authorization": OPERATOR, "Content_Type": "application/json", "If_Match": '"1"'}
    assert site.status("PATCH", "/api/tuning", big, **headers) == 422
    statuses(site, 25, Authorization=f"Bearer {secrets[-1]}")
    for sent in BAD:
        first_line(site, sent)
    written = site.written()
    for file in site.folder.rglob("*"):
        if file.is_file() and file.name != "tokens.json":
            written += file.read_bytes().decode("latin-1")
    for secret in secrets:
        assert secret not in told.decode()
        assert secret not in written
    assert "wrong tokens from 127.0.0.1" in site.written()
    assert (site.folder / "audit.jsonl").stat().st_size > 0


def test_the_process_watches_who_drives(site):
    pause, path = threading.Event(), site.folder / "audit.jsonl"
    for _ in range(1200):
        if path.exists() and '"client takeover"' in path.read_text():
            return
        pause.wait(0.05)
    raise AssertionError("nobody watched")


def test_a_flood_of_nonsense_does_not_fill_the_log(site):
    before = len(site.written())
    for _ in range(40):
        for sent in BAD:
            first_line(site, sent)
    assert len(site.written()) - before < 500
