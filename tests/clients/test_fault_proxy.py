"""The proxy over real sockets: fates are those of the seed, sessions are bounded."""

import asyncio
import errno
import socket
import time
from collections.abc import AsyncIterator, Callable
from math import inf
from typing import Any

import pytest
from motion_clients import fault_proxy
from motion_clients.delay_line import MOST_HELD
from motion_clients.fault_proxy import MOST_SESSIONS, FaultProxy, seed_of
from motion_clients.flawed_link import FlawedLink, LinkFlaws

HERE = ("127.0.0.1", 0)
PATIENCE = 60.0
SPOILED = LinkFlaws(loss=0.2, duplicate=0.2, corrupt=0.2, truncate=0.2)


class End:
    """A UDP socket of a test."""

    def __init__(self, peer: tuple[str, int] | None = None, at: tuple[str, int] = HERE) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setblocking(False)
        self.socket.bind(at)
        self.address: tuple[str, int] = self.socket.getsockname()
        self.peer = peer

    def send(self, datagram: bytes, to: Any = None) -> None:
        self.socket.sendto(datagram, to or self.peer)

    async def receive(self) -> tuple[bytes, Any]:
        loop = asyncio.get_running_loop()
        return await asyncio.wait_for(loop.sock_recvfrom(self.socket, 65535), PATIENCE)

    def has_nothing(self) -> bool:
        try:
            self.socket.recvfrom(65535)
        except BlockingIOError:
            return True
        return False


@pytest.fixture
async def target() -> AsyncIterator[End]:
    end = End()
    yield end
    end.socket.close()


@pytest.fixture
async def peers() -> AsyncIterator[list[End]]:
    ends: list[End] = []
    yield ends
    for end in ends:
        end.socket.close()


async def until(what: Callable[[], Any]) -> None:
    async with asyncio.timeout(PATIENCE):
        while not what():  # noqa: ASYNC110  what is awaited are counters, which tell nobody
            await asyncio.sleep(0.001)


def predicted(flaws: LinkFlaws, seed: int, sent: list[bytes]) -> list[bytes]:
    link = FlawedLink(flaws, seed=seed)
    return [arrival.datagram for datagram in sent for arrival in link.carry(0.0, datagram)]


def assert_all_accounted_for(proxy: FaultProxy) -> None:
    for counts, waiting in ((proxy.there, "there"), (proxy.back, "back")):
        into = counts.received + counts.duplicated
        out = counts.lost + counts.dropped + counts.sent + counts.unsent
        assert into == out + proxy.waiting[waiting]


async def test_fates_over_sockets_are_those_of_the_seed(target, peers):
    sent = [b"packet %3d" % k for k in range(100)]
    async with FaultProxy(HERE, target.address, there=SPOILED, back=SPOILED, seed=5) as proxy:
        for session in range(2):
            peers.append(peer := End(proxy.address))
            arriving = predicted(SPOILED, seed_of(5, session, "there"), sent)
            for datagram in sent:
                peer.send(datagram)
            arrived = [await target.receive() for _ in arriving]
            assert [datagram for datagram, _ in arrived] == arriving
            assert len(set(arriving) & set(sent)) < len(sent)
            (upstream,) = {address for _, address in arrived}

            # what the target answers meets fates of its own, and reaches this peer only
            returning = predicted(SPOILED, seed_of(5, session, "back"), sent)
            assert returning != arriving
            for datagram in sent:
                target.send(datagram, upstream)
            assert [await peer.receive() for _ in returning] == [
                (datagram, proxy.address) for datagram in returning
            ]
            assert all(end.has_nothing() for end in (target, *peers))
        assert proxy.opened == 2
        assert proxy.there.received == proxy.back.received == 200
        assert proxy.there.changed > 0
        assert proxy.waiting == {"there": 0, "back": 0}
        assert_all_accounted_for(proxy)


async def test_a_sound_link_carries_every_size_untouched(target, peers):
    async with FaultProxy(HERE, target.address) as proxy:
        peers.append(peer := End(proxy.address))
        for size in (0, 1, 1200, 65507):
            datagram = bytes(k % 251 for k in range(size))
            peer.send(datagram)
            arrived, upstream = await target.receive()
            target.send(arrived, upstream)
            assert await peer.receive() == (datagram, proxy.address)
        assert proxy.there.sent == proxy.back.sent == 4
        assert proxy.peers == [f"127.0.0.1:{peer.address[1]}"]


async def test_delay_is_at_least_what_was_asked_for(target, peers):
    flaws = LinkFlaws(delay=0.05)
    async with FaultProxy(HERE, target.address, there=flaws, back=flaws) as proxy:
        peers.append(peer := End(proxy.address))
        begun = time.monotonic()
        peer.send(b"a")
        peer.send(b"b")
        await until(lambda: proxy.there.received == 2)
        assert proxy.waiting == {"there": 2, "back": 0}
        first, upstream = await target.receive()
        assert time.monotonic() - begun >= 0.05
        assert (first, (await target.receive())[0]) == (b"a", b"b")
        target.send(b"c", upstream)
        assert (await peer.receive())[0] == b"c"
        assert time.monotonic() - begun >= 0.1
        assert_all_accounted_for(proxy)


async def test_the_later_packet_with_the_shorter_way_overtakes(target, peers):
    flaws = LinkFlaws(jitter=0.2)
    sent = [bytes([k]) for k in range(8)]
    async with FaultProxy(HERE, target.address, there=flaws, seed=1) as proxy:
        peers.append(peer := End(proxy.address))
        for datagram in sent:
            peer.send(datagram)
        arrived = [(await target.receive())[0] for _ in sent]
    assert sorted(arrived) == sent
    assert arrived != sent


async def test_who_is_not_held_back_does_not_wait_for_who_is(target, peers):
    sent = [bytes([k]) for k in range(20)]
    flaws = LinkFlaws(delay=0.01, reorder=0.5, reorder_delay=600.0)
    link = FlawedLink(flaws, seed=seed_of(4, 0, "there"))
    at_once = [d for d in sent for arrival in link.carry(0.0, d) if arrival.delay < 1.0]
    assert 3 < len(at_once) < 17
    assert at_once[0] != sent[0]
    async with FaultProxy(HERE, target.address, there=flaws, seed=4) as proxy:
        peers.append(peer := End(proxy.address))
        for datagram in sent:
            peer.send(datagram)
        assert [(await target.receive())[0] for _ in at_once] == at_once
        assert proxy.waiting["there"] == len(sent) - len(at_once)


async def test_silence_swallows_everything(target, peers):
    silent = LinkFlaws(silences=((0.0, inf),))
    async with FaultProxy(HERE, target.address, there=silent) as proxy:
        peers.append(peer := End(proxy.address))
        for _ in range(10):
            peer.send(b"anybody?")
        await until(lambda: proxy.there.received == 10)
        assert proxy.there.silenced == proxy.there.lost == 10
        assert target.has_nothing()


async def test_sessions_are_bounded_and_the_quietest_makes_room(target, peers, monkeypatch):
    slow = LinkFlaws(delay=600.0)
    async with FaultProxy(HERE, target.address, there=slow) as proxy:
        for _ in range(MOST_SESSIONS + 3):
            peers.append(peer := End(proxy.address))
            peer.send(b"here")
            await until(lambda: proxy.there.received + proxy.refused == len(peers))
        assert (proxy.opened, proxy.refused) == (MOST_SESSIONS, 3)
        assert len(proxy.peers) == MOST_SESSIONS
        peers[0].send(b"still here")
        await until(lambda: proxy.there.received == MOST_SESSIONS + 1)

        monkeypatch.setattr(fault_proxy, "IDLE", 0.0)
        peers[-1].send(b"now?")
        await until(lambda: proxy.opened == MOST_SESSIONS + 1)
        assert len(proxy.peers) == MOST_SESSIONS
        names = [f"127.0.0.1:{peer.address[1]}" for peer in peers]
        assert names[0] in proxy.peers
        assert names[1] not in proxy.peers
        assert names[-1] in proxy.peers
        assert proxy.there.dropped == 1  # what the one that left had on its way
        assert_all_accounted_for(proxy)


async def test_a_target_that_is_away_is_counted_and_may_come_back(target, peers):
    address = target.address
    target.socket.close()
    async with FaultProxy(HERE, address) as proxy:
        peers.append(peer := End(proxy.address))
        for k in range(1, 6):
            peer.send(b"nobody")
            await until(lambda k=k: proxy.there.received == k)
        await until(lambda: proxy.unreachable > 0)
        peers.append(returned := End(at=address))
        peer.send(b"somebody")
        assert (await returned.receive())[0] == b"somebody"
        assert_all_accounted_for(proxy)


async def test_news_of_one_packet_does_not_cost_the_next(target, peers):
    address = target.address
    target.socket.close()
    async with FaultProxy(HERE, address) as proxy:
        peers.append(peer := End(proxy.address))
        # both are read in one go: sending the second meets the refusal of the first
        peer.send(b"a")
        peer.send(b"b")
        await until(lambda: proxy.unreachable == 2)
        assert proxy.there.sent == 2


async def test_what_the_network_refuses_is_counted(target, peers):
    async with FaultProxy(HERE, target.address) as proxy:
        peers.append(peer := End(proxy.address))
        peer.send(b"small")
        await target.receive()
        (session,) = proxy._sessions.values()
        session.upstream.shutdown(socket.SHUT_WR)
        peer.send(b"in vain")
        await until(lambda: proxy.there.received == 2)
        assert (proxy.there.sent, proxy.there.unsent) == (1, 1)
        assert_all_accounted_for(proxy)


async def test_a_flood_takes_bounded_room(target, peers):
    slow = LinkFlaws(delay=600.0)
    async with FaultProxy(HERE, target.address, there=slow) as proxy:
        peers.append(peer := End(proxy.address))
        sent = 0
        while proxy.there.received < 2 * MOST_HELD:
            for _ in range(32):
                peer.send(b"x" * 100)
            sent += 32
            await until(lambda s=sent: proxy.there.received == s)
        assert proxy.waiting["there"] == MOST_HELD
        assert proxy.there.dropped == sent - MOST_HELD
        assert_all_accounted_for(proxy)
    assert target.has_nothing()


@pytest.mark.parametrize("listen", ["127.0.0.1", "0.0.0.0"])
async def test_a_proxy_to_itself_is_refused(target, listen):
    port = target.address[1]
    target.socket.close()
    with pytest.raises(OSError, match="itself") as refused:
        async with FaultProxy((listen, port), ("127.0.0.1", port)):
            pass
    assert refused.value.errno == errno.ELOOP


async def test_a_taken_address_is_refused(target):
    with pytest.raises(OSError, match="in use"):
        async with FaultProxy(target.address, ("127.0.0.1", 9)):
            pass


def test_every_session_and_way_has_a_seed_of_its_own():
    seeds = {
        seed_of(seed, session, way)
        for seed in range(20)
        for session in range(20)
        for way in ("there", "back")
    }
    assert len(seeds) == 800
    # written down once: the fates of a seed stay what they are from one version to the next
    assert seed_of(0, 0, "there") == int.from_bytes(bytes.fromhex("4348269128689dba"), "big")
