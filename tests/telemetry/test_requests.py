import json
import os
import socket
import threading

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from motionserver.telemetry.requests import DRAIN, MAX_BYTES, RequestError, RequestServer, ask


@pytest.fixture
def server(tmp_path):
    made = RequestServer(tmp_path / "guard.sock")
    yield made
    made.close()


def throw(tmp_path, data):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as link:
        link.connect(str(tmp_path / "guard.sock"))
        link.send(data)


def test_only_the_owner_may_ask(server, tmp_path):
    assert (tmp_path / "guard.sock").stat().st_mode & 0o777 == 0o600
    assert server.poll() == []


def test_a_request_is_answered(server, tmp_path):
    done = threading.Event()

    def serve():
        while not done.is_set():
            for message, address in server.poll():
                server.answer(address, {"ok": message["op"]})

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        assert ask(tmp_path / "guard.sock", {"op": "park"}, 20.0) == {"ok": "park"}
    finally:
        done.set()
        thread.join()
    assert [entry.name for entry in tmp_path.iterdir()] == ["guard.sock"]


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\xff\xfe",
        b"park",
        b"[]",
        b'"park"',
        b"{}",
        b'{"op": 1}',
        b'{"op": null}',
        b"{" * 4000,
        b"[" * 4000,
        b'{"op": "park", "x": ' + b"1" * 4090 + b"}",
        json.dumps({"op": "park", "x": "y" * MAX_BYTES}).encode(),
        b'{"op":' + b"9" * 4080 + b"}",
    ],
    ids=range(13),
)
def test_what_is_no_request_is_counted(server, tmp_path, data):
    throw(tmp_path, data)
    assert server.poll() == []
    assert server.malformed == 1


@given(st.binary(max_size=300))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_garbage_never_raises(server, tmp_path, data):
    throw(tmp_path, data)
    for message, address in server.poll():
        assert isinstance(message["op"], str)
        assert address == ""


def test_a_request_of_just_the_largest_size(server, tmp_path):
    data = json.dumps({"op": "park", "x": ""}).encode()
    throw(tmp_path, data[:-2] + b"y" * (MAX_BYTES - len(data)) + b'"}')
    assert server.poll()[0][0]["op"] == "park"


def test_a_flood_is_served_a_few_at_a_time(server, tmp_path):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as link:
        link.connect(str(tmp_path / "guard.sock"))
        link.setblocking(False)
        sent = 0
        try:
            while sent < 10_000:
                link.send(b'{"op": "park"}')
                sent += 1
        except BlockingIOError:
            pass
    assert len(server.poll()) == min(DRAIN, sent)
    taken = DRAIN
    while more := server.poll():
        assert len(more) <= DRAIN
        taken += len(more)
    assert taken == sent


def test_an_answer_to_a_dead_peer_is_lost(server, tmp_path):
    gone = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    gone.bind(str(tmp_path / "peer.sock"))
    gone.sendto(b'{"op": "park"}', str(tmp_path / "guard.sock"))
    gone.close()
    ((_, address),) = server.poll()
    server.answer(address, {"ok": True})
    (tmp_path / "peer.sock").unlink()
    server.answer(address, {"ok": True})
    server.answer("", {"ok": True})


def test_a_peer_that_does_not_read_does_not_block(server, tmp_path):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as deaf:
        deaf.bind(str(tmp_path / "deaf.sock"))
        for _ in range(5000):
            server.answer(str(tmp_path / "deaf.sock"), {"ok": True})
        server.answer(str(tmp_path / "deaf.sock"), {"ok": "x" * 1_000_000})


def test_nobody_listens(tmp_path):
    with pytest.raises(RequestError, match="is the server running"):
        ask(tmp_path / "none.sock", {"op": "park"}, 0.1)
    with pytest.raises(RequestError, match="is the server running"):
        ask(tmp_path / "no" / "such" / "none.sock", {"op": "park"}, 0.1)
    with pytest.raises(RequestError):
        ask(tmp_path / ("long" * 40) / "none.sock", {"op": "park"}, 0.1)
    assert list(tmp_path.iterdir()) == []


def test_nobody_answers(server, tmp_path):
    with pytest.raises(RequestError, match=r"in 0\.01 s"):
        ask(tmp_path / "guard.sock", {"op": "park"}, 0.01)


@pytest.mark.parametrize("answer", [b"[]", b"7"])
def test_an_answer_that_is_no_object(tmp_path, monkeypatch, answer):
    monkeypatch.setattr(socket.socket, "recv", lambda self, size: answer)
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as odd:
        odd.bind(str(tmp_path / "odd.sock"))
        with pytest.raises(RequestError, match="something else"):
            ask(tmp_path / "odd.sock", {"op": "park"})


def test_a_socket_left_by_a_killed_process_is_no_obstacle(server, tmp_path, monkeypatch):
    """Process numbers come again; what such a one left behind must not stop the next."""
    for number in range(200):
        (tmp_path / f"ask-{os.getpid()}-{number}.sock").touch()
    with pytest.raises(RequestError, match="no answer"):
        ask(tmp_path / "guard.sock", {"op": "park"}, 0.01)
    assert server.poll()[0][0] == {"op": "park"}


def test_a_server_takes_over_a_socket_left_behind(tmp_path):
    path = tmp_path / "guard.sock"
    RequestServer(path).close()
    assert path.exists()
    again = RequestServer(path)
    throw(tmp_path, b'{"op": "x"}')
    assert len(again.poll()) == 1
    again.close()
