"""HTTP connections that do not wait for ever, and make room for each other."""

from __future__ import annotations

import asyncio
from collections import Counter
from typing import Any, ClassVar

from uvicorn.protocols.http.h11_impl import H11Protocol


class PatientProtocol(H11Protocol):
    """A connection that is closed when it neither asks nor reads, and yields to newcomers.

    The server's own keep-alive limit counts from an answer. A connection that never asks, sends
    its headers one byte at a time, or does not read its answer would otherwise hold one of the
    few places. When all places are taken the connection that has been idle longest goes, of the
    address that has most of them: who floods, pushes out itself.
    """

    check_every: ClassVar[float] = 5.0
    """Time between two checks [s]."""
    most: ClassVar[int] = 96
    """Connections at a time."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Make room and begin to watch."""
        super().connection_made(transport)
        self._was_idle = False
        self._stuck_since: float | None = None
        self._made_at = self.loop.time()
        self._is_lost = False
        if len(self.connections) > self.most:
            self._make_room()
        self.loop.call_later(self.check_every, self._check)

    def connection_lost(self, exc: Exception | None) -> None:
        """Nothing to watch any more."""
        self._is_lost = True
        super().connection_lost(exc)

    def pause_writing(self) -> None:
        """The other side does not read as fast as it is told."""
        super().pause_writing()
        self._stuck_since = self.loop.time()

    def resume_writing(self) -> None:
        """It has caught up."""
        super().resume_writing()
        self._stuck_since = None

    @property
    def is_idle(self) -> bool:
        """Whether no request is being answered."""
        return self.cycle is None or self.cycle.response_complete

    def _make_room(self) -> None:
        others = [one for one in self.connections if isinstance(one, PatientProtocol)]
        idle = [one for one in others if one.is_idle and one is not self]
        if not idle:
            self._drop()
            return
        held = Counter(one._address for one in others)
        max(idle, key=lambda one: (held[one._address], -one._made_at))._drop()

    @property
    def _address(self) -> str:
        return self.client[0] if self.client else ""

    def _drop(self) -> None:
        # now, not when the loop comes to it: a rush must not count those that are gone
        self.connections.discard(self)
        self.transport.abort()

    def _check(self) -> None:
        if self._is_lost:
            return
        stuck = self._stuck_since
        if self.transport.is_closing() or (
            stuck is not None and self.loop.time() - stuck > 1.5 * self.check_every
        ):
            # closing waits for a reader that does not read
            self._drop()
            return
        idle = self.is_idle
        if idle and self._was_idle:
            self.transport.close()
        self._was_idle = idle
        self.loop.call_later(self.check_every, self._check)


class PatientLoop(asyncio.SelectorEventLoop):
    """An event loop whose servers do not wait a minute for a handshake that does not come.

    Nor do they fill the log: what goes wrong with every connection is told once a second.
    """

    handshake: ClassVar[float] = 5.0
    """Time a TLS handshake may take [s]."""
    told_every: ClassVar[float] = 1.0
    """Time between two reports of trouble [s]."""

    def __init__(self) -> None:
        super().__init__()
        self._told_at = float("-inf")
        self._untold = 0

    def call_exception_handler(self, context: dict[str, Any]) -> None:
        """Tell what went wrong, unless something was told just now."""
        if self.time() - self._told_at < self.told_every:
            self._untold += 1
            return
        if self._untold:
            context["message"] = f"{context.get('message')} ({self._untold} others untold)"
        self._told_at, self._untold = self.time(), 0
        super().call_exception_handler(context)

    async def create_server(self, *args: Any, **named: Any) -> asyncio.Server:  # noqa: ANN401
        """Listen; with TLS, with patience that ends."""
        if named.get("ssl") is not None:
            named.setdefault("ssl_handshake_timeout", self.handshake)
            named.setdefault("ssl_shutdown_timeout", self.handshake)
        return await super().create_server(*args, **named)
