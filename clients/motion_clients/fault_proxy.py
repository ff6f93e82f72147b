"""A UDP proxy between two programs whose link is flawed, the same way for the same seed.

Every peer that sends to it has a session: a socket of its own towards the target, and one flawed
line each way. The fates are drawn by the pure :mod:`motion_clients.flawed_link`; here are only
sockets and the clock.
"""

from __future__ import annotations

import asyncio
import errno
import hashlib
import socket
from collections.abc import Callable
from types import TracebackType
from typing import Any, Final, Self

from .delay_line import DelayLine, WayCounts
from .flawed_link import LinkFlaws
from .timed_way import TimedWay

MOST_SESSIONS: Final = 16
"""Peers served at the same time."""

IDLE: Final = 60.0
"""Silence after which a session may be given to a new peer [s]."""

_DRAIN: Final = 64  # datagrams read per wake-up, so that a flood cannot hold the loop
_LARGEST: Final = 65535
_BUFFER: Final = 1 << 20  # [bytes], what the kernel may hold for us

Peer = tuple[Any, ...]
"""An address as its socket names it: host, port, and for IPv6 two more."""


def resolve(host: str, port: int) -> tuple[socket.AddressFamily, Peer]:
    """Family and address of a UDP end.

    Raises:
        OSError: The name is unknown.
    """
    family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
    return family, address


def seed_of(seed: int, session: int, way: str) -> int:
    """Seed of one way ("there" or "back") of the so-manyth session, from 0, of a proxy."""
    digest = hashlib.sha256(f"{seed} {session} {way}".encode()).digest()
    return int.from_bytes(digest[:8], "big")


class _Session:
    """One peer: a connected socket to the target, and both ways."""

    def __init__(self, upstream: socket.socket, there: TimedWay, back: TimedWay) -> None:
        self.upstream, self.there, self.back = upstream, there, back
        self.heard = 0.0

    def close(self) -> None:
        asyncio.get_running_loop().remove_reader(self.upstream)
        self.upstream.close()
        self.there.close()
        self.back.close()


class FaultProxy:
    """A proxy on a UDP port; use as an async context manager.

    Attributes:
        there: What happened to the datagrams of all peers towards the target.
        back: What happened to the target's replies.
        opened: Sessions opened so far.
        refused: Datagrams of peers for whom no session was free.
        unreachable: Times that the target's port was told to be closed.
    """

    def __init__(
        self,
        listen: tuple[str, int],
        target: tuple[str, int],
        *,
        there: LinkFlaws | None = None,
        back: LinkFlaws | None = None,
        seed: int = 0,
    ) -> None:
        """A proxy that does not listen yet.

        Args:
            listen: Host and port to bind; port 0 takes a free one, see :attr:`address`.
            target: Host and port that datagrams go to.
            there: Flaws on the way to the target; silences count from the start [s].
            back: Flaws of the replies' way.
            seed: Of everything random.
        """
        self._listen, self._target = listen, target
        self._flaws = {"there": there, "back": back}
        self._seed = seed
        self._sessions: dict[Peer, _Session] = {}
        self._origin = 0.0
        self._socket: socket.socket | None = None
        self._family, self._to = socket.AF_INET, ("", 0)
        self.there, self.back = WayCounts(), WayCounts()
        self.opened = self.refused = self.unreachable = 0

    @property
    def address(self) -> tuple[str, int]:
        """Address listened on."""
        host, port = self._open_socket.getsockname()[:2]
        return host, port

    @property
    def now(self) -> float:
        """Time since the start [s]."""
        return asyncio.get_running_loop().time() - self._origin

    @property
    def waiting(self) -> dict[str, int]:
        """Datagrams on their way "there" and "back"."""
        sessions = self._sessions.values()
        return {
            "there": sum(len(session.there.line) for session in sessions),
            "back": sum(len(session.back.line) for session in sessions),
        }

    @property
    def peers(self) -> list[str]:
        """Peers with a session, in the order of their coming."""
        return [f"{peer[0]}:{peer[1]}" for peer in self._sessions]

    async def __aenter__(self) -> Self:
        """Listen.

        Raises:
            OSError: The address cannot be bound, a name is unknown, there is no way to the target,
                or it is the proxy itself (ELOOP).
        """
        self._family, self._to = resolve(*self._target)
        family, address = resolve(*self._listen)
        listening = _socket(family)
        try:
            listening.bind(address)
            self._refuse_itself(listening)
        except OSError:
            listening.close()
            raise
        loop = asyncio.get_running_loop()
        self._socket = listening
        self._origin = loop.time()
        loop.add_reader(listening, self._hear_peers)
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Stop; what is on its way is not delivered."""
        asyncio.get_running_loop().remove_reader(self._open_socket)
        self._open_socket.close()
        self._socket = None
        for session in self._sessions.values():
            session.close()

    @property
    def _open_socket(self) -> socket.socket:
        if self._socket is None:
            raise RuntimeError("the proxy listens only inside its context")
        return self._socket

    def _refuse_itself(self, listening: socket.socket) -> None:
        with _socket(self._family) as probe:
            probe.connect(self._to)
            host, port = listening.getsockname()[:2]
            # towards an address of its own a computer sends from that very address
            is_own = probe.getsockname()[0] == probe.getpeername()[0]
            if is_own and port == self._to[1] and host in (self._to[0], "0.0.0.0", "::"):
                raise OSError(errno.ELOOP, "the target is the proxy itself")

    def _hear_peers(self) -> None:
        for _ in range(_DRAIN):
            try:
                datagram, peer = self._open_socket.recvfrom(_LARGEST)
            except OSError:
                return
            session = self._sessions.get(peer) or self._welcome(peer)
            if session is None:
                self.refused += 1
                continue
            session.heard = self.now
            session.there.put(datagram)

    def _hear_target(self, session: _Session) -> None:
        for _ in range(_DRAIN):
            try:
                datagram = session.upstream.recv(_LARGEST)
            except ConnectionRefusedError:
                self.unreachable += 1
                continue
            except OSError:
                return
            session.heard = self.now
            session.back.put(datagram)

    def _welcome(self, peer: Peer) -> _Session | None:
        """A session for a new peer; None if all are in use."""
        if len(self._sessions) >= MOST_SESSIONS:
            quietest = min(self._sessions, key=lambda known: self._sessions[known].heard)
            if self.now - self._sessions[quietest].heard < IDLE:
                return None
            left = self._sessions.pop(quietest)
            self.there.dropped += len(left.there.line)
            self.back.dropped += len(left.back.line)
            left.close()
        upstream = _socket(self._family)
        try:
            upstream.connect(self._to)
        except OSError:
            upstream.close()
            return None

        def send_there(datagram: bytes) -> None:
            try:
                upstream.send(datagram)
            except ConnectionRefusedError:
                # news of an earlier datagram; this one was not even tried
                self.unreachable += 1
                upstream.send(datagram)

        def send_back(datagram: bytes) -> None:
            self._open_socket.sendto(datagram, peer)

        session = _Session(
            upstream,
            self._way("there", self.there, send_there),
            self._way("back", self.back, send_back),
        )
        self.opened += 1
        self._sessions[peer] = session
        asyncio.get_running_loop().add_reader(upstream, self._hear_target, session)
        return session

    def _way(self, name: str, counts: WayCounts, send: Callable[[bytes], None]) -> TimedWay:
        seed = seed_of(self._seed, self.opened, name)
        return TimedWay(
            DelayLine(self._flaws[name], seed=seed, counts=counts), lambda: self.now, send
        )


def _socket(family: socket.AddressFamily) -> socket.socket:
    made = socket.socket(family, socket.SOCK_DGRAM)
    made.setblocking(False)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
    return made
