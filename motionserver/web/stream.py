"""Server-sent events: the shared status, about twenty times a second."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import AsyncIterator
from typing import Final

from starlette.responses import Response, StreamingResponse
from starlette.types import Receive, Scope, Send

from motionserver.web.refusal import Refusal
from motionserver.web.snapshot import PERIOD, StatusBoard

MOST_READERS: Final = 24
"""Streams at a time; the rest of the requests stay free for others."""
MOST_OF_ONE: Final = 16
"""Streams of one address, so that somebody else can still look."""


class Streams:
    """Hands out streams and counts them.

    Args:
        board: Where the status comes from.
    """

    def __init__(self, board: StatusBoard) -> None:
        self._board = board
        self._open: Counter[str] = Counter()

    @property
    def readers(self) -> int:
        """How many streams are open."""
        return self._open.total()

    def open(self, path: str, address: str) -> Response:
        """Start one more stream.

        Args:
            path: Named in errors.
            address: Who reads.

        Raises:
            Refusal: Too many are open (503).
        """
        if self.readers >= MOST_READERS or self._open[address] >= MOST_OF_ONE:
            raise Refusal(
                503,
                "too many streams are open",
                path,
                f"at most {MOST_READERS}, {MOST_OF_ONE} of them to one address",
                "close other pages, or read /api/status now and then",
                headers={"retry-after": "2"},
            )
        return _CountedStream(self._events(), self._open, address)

    async def _events(self) -> AsyncIterator[bytes]:
        """A slow reader is not queued for: it simply gets the status of when it is ready."""
        yield b"retry: 1000\n\n"
        shown = 0
        while True:
            status = self._board.current()
            if status.made_ns != shown:
                shown = status.made_ns
                yield b"data: " + status.text + b"\n\n"
            await asyncio.sleep(PERIOD)


class _CountedStream(StreamingResponse):
    """A stream that holds its place from the moment it is made, so that a rush cannot slip by."""

    def __init__(self, events: AsyncIterator[bytes], places: Counter[str], address: str) -> None:
        headers = {"cache-control": "no-store", "x-accel-buffering": "no"}
        super().__init__(events, media_type="text/event-stream", headers=headers)
        self._places, self._address = places, address
        places[address] += 1

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send until the reader leaves."""
        try:
            await super().__call__(scope, receive, send)
        finally:
            self._places[self._address] -= 1
            if not self._places[self._address]:
                del self._places[self._address]
