"""Server-sent events: the shared status, about twenty times a second."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from typing import Final

from starlette.responses import Response, StreamingResponse

from motionserver.web.refusal import Refusal
from motionserver.web.snapshot import PERIOD, StatusBoard

MOST_READERS: Final = 24
"""Streams at a time; the rest of the connections stay free for requests."""


class Streams:
    """Hands out streams and counts them.

    Args:
        board: Where the status comes from.
    """

    def __init__(self, board: StatusBoard) -> None:
        self._board = board
        self.readers = 0

    def open(self, path: str) -> Response:
        """Start one more stream.

        Raises:
            Refusal: Too many are open (503).
        """
        if self.readers >= MOST_READERS:
            raise Refusal(
                503,
                "too many streams are open",
                path,
                f"at most {MOST_READERS}",
                "close other pages, or read /api/status now and then",
                headers={"retry-after": "2"},
            )
        headers = {"cache-control": "no-store", "x-accel-buffering": "no"}
        return StreamingResponse(self._events(), media_type="text/event-stream", headers=headers)

    async def _events(self) -> AsyncIterator[bytes]:
        """A slow reader is not queued for: it simply gets the status of when it is ready."""
        self.readers += 1
        try:
            yield b"retry: 1000\n\n"
            shown = 0
            while True:
                status = self._board.current()
                if status.made_ns != shown:
                    shown = status.made_ns
                    yield b"data: " + status.text + b"\n\n"
                await asyncio.sleep(PERIOD)
        finally:
            self.readers -= 1
