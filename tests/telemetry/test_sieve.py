"""The sieve on real sockets: who and what gets through, what is counted, how it opens again."""

import contextlib
import socket
from collections.abc import Iterator

import pytest

from motionserver.telemetry.sieve import dropped, sieve, sieve_program, unsieve

V4, V6 = "127.0.0.1", "::1"


def bound(host: str) -> socket.socket:
    link = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_DGRAM)
    link.bind((host, 0))
    link.setblocking(False)
    return link


@pytest.fixture(params=[V4, V6])
def scene(request: pytest.FixtureRequest) -> Iterator[tuple[socket.socket, ...]]:
    with contextlib.ExitStack() as stack:
        try:
            yield tuple(stack.enter_context(bound(request.param)) for _ in range(4))
        except OSError:
            pytest.skip("no IPv6 here")


def heard(link: socket.socket) -> list[bytes]:
    out = []
    with contextlib.suppress(BlockingIOError):
        while True:
            out.append(link.recv(4096))
    return out


def test_only_peers_get_through_and_the_rest_is_counted(scene: tuple[socket.socket, ...]) -> None:
    link, one, two, stranger = scene
    here = link.getsockname()
    peers = [sender.getsockname()[:2] for sender in (one, two)]
    assert sieve(link, peers) == ""
    before = dropped(link)
    for k, sender in enumerate((one, two, stranger, one)):
        sender.sendto(b"%d" % k, here)
    assert heard(link) == [b"0", b"1", b"3"]
    assert dropped(link) == before + 1
    assert sieve(link, peers[:1]) == ""
    two.sendto(b"x", here)
    assert heard(link) == []
    assert unsieve(link) == ""
    stranger.sendto(b"again", here)
    assert heard(link) == [b"again"]


def test_lengths_at_both_ends(scene: tuple[socket.socket, ...]) -> None:
    link, sender, *_ = scene
    assert sieve(link, [], 88, 90) == ""
    for size in (0, 1, 87, 88, 89, 90, 91, 2000, 60000):
        sender.sendto(bytes(size), link.getsockname())
    assert [len(data) for data in heard(link)] == [88, 89, 90]
    assert sieve(link, [sender.getsockname()[:2]]) == ""
    for size in (0, 60000):
        sender.sendto(bytes(size), link.getsockname())
    assert [len(data) for data in heard(link)] == [0, 4096]


def test_what_waits_already_stays(scene: tuple[socket.socket, ...]) -> None:
    link, one, two, _ = scene
    two.sendto(b"before", link.getsockname())
    sieve(link, [one.getsockname()[:2]])
    assert heard(link) == [b"before"]


def test_a_full_buffer_counts_too(scene: tuple[socket.socket, ...]) -> None:
    link, sender, *_ = scene
    link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    for _ in range(100):
        sender.sendto(b"x", link.getsockname())
    lost = dropped(link)
    assert len(heard(link)) + lost == 100
    assert lost > 0


def test_a_socket_for_both_knows_its_old_senders() -> None:
    try:
        link = bound("::")
    except OSError:
        pytest.skip("no IPv6 here")
    with link, bound(V4) as sender, bound(V4) as stranger:
        port = link.getsockname()[1]
        sender.sendto(b"1", (V4, port))
        _, peer = link.recvfrom(10)
        assert peer[0].startswith("::ffff:")
        assert sieve(link, [peer[:2]]) == ""
        stranger.sendto(b"2", (V4, port))
        sender.sendto(b"3", (V4, port))
        assert heard(link) == [b"3"]


def test_the_same_port_on_another_host_is_a_stranger() -> None:
    with bound("0.0.0.0") as link, bound("127.0.0.2") as sender:
        port = link.getsockname()[1]
        sieve(link, [("127.0.0.3", sender.getsockname()[1])])
        sender.sendto(b"x", (V4, port))
        assert heard(link) == []
        sieve(link, [("127.0.0.2", sender.getsockname()[1])])
        sender.sendto(b"x", (V4, port))
        assert heard(link) == [b"x"]


def test_a_refusal_is_told_and_nothing_raises() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        assert "refuses" in unsieve(link)
        many = [(V4, port) for port in range(1, 2000)]
        assert "refuses" in sieve(link, many)
        assert "localhost" in sieve(link, [("localhost", 1)])
    assert dropped(link) == 0


def test_the_program_is_short() -> None:
    assert len(sieve_program([(V4, 1), (V6, 2)], 1, 2)) < 40
