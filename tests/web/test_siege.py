"""The real process under attack, while somebody's stream goes on and somebody else parks.

In full: ``pytest -m campaign -s tests/web/test_siege.py``.
"""

import contextlib
import http.client
import json
import socket
import threading
import time
from pathlib import Path

import pytest
from browser.scene import TOKENS
from web_process import Process

OPERATOR = f"Bearer {TOKENS['operator']}"
HEAD = b"Host: 127.0.0.1\r\nAuthorization: " + OPERATOR.encode() + b"\r\n"
PATCH = b"PATCH /api/tuning HTTP/1.1\r\n" + HEAD + b"Content-Type: application/json\r\n"
UPGRADE = (
    b"GET /api/stream HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
    b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n"
)
GONE = (ConnectionError, TimeoutError)


class Viewer(threading.Thread):
    """Reads the stream, and remembers when each status came."""

    def __init__(self, site):
        super().__init__(daemon=True)
        self.came, self.ended = [], ""
        self._line = http.client.HTTPConnection("127.0.0.1", site.port, timeout=30)
        self._line.request("GET", "/api/stream", headers={"Authorization": OPERATOR})
        self._answer = self._line.getresponse()
        assert self._answer.status == 200
        self._wanted = True
        self.start()

    def run(self):
        try:
            while self._wanted:
                line = self._answer.readline()
                if not line:
                    break
                if line.startswith(b"data: "):
                    json.loads(line[6:])
                    self.came.append(time.monotonic())
        except Exception as error:
            self.ended = repr(error)

    def goes_on(self):
        """Wait for two more statuses: nothing before this made the stream end."""
        before = len(self.came)
        pause, until = threading.Event(), time.monotonic() + 60
        while len(self.came) < before + 2:
            assert self.is_alive(), f"the stream ended: {self.ended}"
            assert time.monotonic() < until, "the stream stands still"
            pause.wait(0.02)

    def leave(self):
        self._wanted = False
        self.join(30)
        self._line.close()


def memory(site):
    """Resident memory of the page's process [B]."""
    text = Path(f"/proc/{site.process.pid}/status").read_text()
    return 1024 * int(text.split("VmRSS:")[1].split()[0])


def files(site):
    return len(list(Path(f"/proc/{site.process.pid}/fd").iterdir()))


def reply(link):
    """The first line that comes back, or nothing."""
    try:
        return link.makefile("rb").readline()
    except GONE:
        return b""


def slowloris(site, number):
    """Half-open requests, each fed a header now and then."""
    links = []
    for _ in range(number):
        link = site.connect()
        links.append(link)
        with contextlib.suppress(*GONE):
            link.sendall(b"GET /api/status HTTP/1.1\r\nHost: 127.0.0.1\r\n")
    yield
    for _ in range(3):
        for link in links:
            with contextlib.suppress(*GONE):
                link.sendall(b"X-A: b\r\n")
        yield
    assert files(site) < 200, "more connections than there are places"
    for link in links:
        link.close()


def endless_body(site, number):
    """A body of ``number`` chunks of a megabyte, and the same announced as a whole."""
    for framing in (b"Transfer-Encoding: chunked\r\n\r\n", b"Content-Length: 1073741824\r\n\r\n"):
        with site.connect() as link:
            link.sendall(PATCH + b'If-Match: "1"\r\n' + framing)
            sent, part = 0, b"100000\r\n" + b"[" * 1048576 + b"\r\n"
            try:
                for _ in range(number):
                    link.sendall(part if b"chunked" in framing else part[8:-2])
                    sent += 1
            except GONE:
                pass
            assert b"200" not in reply(link)
        assert sent < number, "all of it was taken"
        yield


def upgrades(site, number):
    """Websocket upgrades, with and without a token, and streams, most of them left open."""
    held = []
    for k in range(number):
        link = site.connect()
        own = b"" if k % 3 else b"Authorization: " + OPERATOR.encode() + b"\r\n"
        plain = b"GET /api/stream HTTP/1.1\r\n" + HEAD + b"\r\n"
        with contextlib.suppress(*GONE):
            link.sendall(UPGRADE + own + b"\r\n" if k % 2 else plain)
        held.append(link)
        if k % 7 == 0:
            link.settimeout(0.5)
            assert b" 101 " not in reply(link)
        while len(held) > 150:
            held.pop(0).close()
        if k % 100 == 0:
            yield
    for link in held:
        link.close()


def deep_json(site, number):
    """Objects and lists within each other, as deep as a body can hold."""
    for opening in (b"[", b'{"a":', b'[{"a":'):
        body = (opening * (65536 // len(opening)))[:65536]
        for _ in range(number):
            with site.connect() as link:
                length = str(len(body)).encode()
                link.sendall(PATCH + b'If-Match: "1"\r\nContent-Length: ' + length + b"\r\n\r\n")
                link.sendall(body)
                assert reply(link).split()[1] in (b"400", b"422")
        yield


def huge_headers(site, number):
    """One header of megabytes, very many small ones, and a path without end."""
    for sent in (
        b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-A: " + b"a" * 32_000_000,
        b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n" + b"X-A: b\r\n" * 4_000_000,
        b"GET /" + b"a" * 32_000_000,
    ):
        for _ in range(number):
            with site.connect() as link:
                with pytest.raises(GONE):
                    link.sendall(sent)
                line = reply(link)
                assert line == b"" or line.split()[1] in (b"400", b"414", b"431"), line
        yield


def pipelining(site, number):
    """Many requests in one breath, the answers read late or never."""
    one = b"GET /api/status HTTP/1.1\r\n" + HEAD + b"\r\n"
    for reads in (True, False):
        with site.connect() as link:
            link.settimeout(30)
            writer = threading.Thread(target=_pour, args=(link, one * number), daemon=True)
            writer.start()
            if reads:
                told, count = link.makefile("rb"), 0
                while count < 20 and (line := told.readline()):
                    # a body ends without an end of line
                    count += b"HTTP/1.1 200 OK" in line
                assert count == 20
            else:
                threading.Event().wait(0.3)
            yield
            link.shutdown(socket.SHUT_RDWR)
            writer.join(30)
        yield


def _pour(link, data):
    with contextlib.suppress(OSError):
        link.sendall(data)


ATTACKS = {
    slowloris: (200, 600),
    endless_body: (64, 1024),
    upgrades: (400, 10_000),
    deep_json: (1, 20),
    huge_headers: (1, 5),
    pipelining: (500, 20_000),
}
"""Size of each attack: as an ordinary test, and in full."""


def besiege(folder, attack, number):
    with Process(folder) as site:
        viewer = Viewer(site)
        viewer.goes_on()
        before = memory(site)
        for _ in attack(site, number):
            viewer.goes_on()
            assert site.status("POST", "/api/park", Authorization=OPERATOR) == 200
        viewer.goes_on()
        assert site.status("GET", "/api/status", Authorization=OPERATOR) == 200
        grown = memory(site) - before
        gaps = sorted(b - a for a, b in zip(viewer.came, viewer.came[1:], strict=False))
        viewer.leave()
        assert grown < 64 * 1024**2, f"{grown / 1024**2:.0f} MiB more than before"
        assert site.process.poll() is None
        assert "Traceback" not in site.written()
        return (
            f"{attack.__name__} {number}: {len(gaps)} statuses, gap p50 "
            f"{1e3 * gaps[len(gaps) // 2]:.0f} ms, largest {1e3 * gaps[-1]:.0f} ms, "
            f"{grown / 1024**2:+.1f} MiB"
        )


@pytest.mark.parametrize("attack", ATTACKS, ids=lambda attack: attack.__name__)
def test_a_stream_goes_on_and_parking_works_under(tmp_path, attack):
    besiege(tmp_path, attack, ATTACKS[attack][0])


@pytest.mark.campaign
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("attack", ATTACKS, ids=lambda attack: attack.__name__)
def test_in_full(tmp_path, attack):
    print(besiege(tmp_path, attack, ATTACKS[attack][1]))
