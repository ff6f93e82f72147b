"""HTTP connections that do not wait for ever for a request to begin or to end."""

from __future__ import annotations

import asyncio
from typing import ClassVar

from uvicorn.protocols.http.h11_impl import H11Protocol


class PatientProtocol(H11Protocol):
    """Closes a connection on which no request is being answered at two checks in a row.

    The server's own keep-alive limit counts from an answer; a connection that never asks, or
    sends its headers one byte at a time, would otherwise hold one of the few places.
    """

    check_every: ClassVar[float] = 5.0
    """Time between two checks [s]."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin to watch."""
        super().connection_made(transport)
        self._was_idle = False
        self.loop.call_later(self.check_every, self._check)

    def _check(self) -> None:
        if self.transport.is_closing():
            return
        idle = self.cycle is None or self.cycle.response_complete
        if idle and self._was_idle:
            self.transport.close()
            return
        self._was_idle = idle
        self.loop.call_later(self.check_every, self._check)
