"""A flawed line in real time: emptied by a timer of the loop whenever a datagram is due."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from .delay_line import DelayLine


class TimedWay:
    """One direction between two ends.

    Attributes:
        line: Where datagrams are held until they are due.
    """

    def __init__(
        self, line: DelayLine, clock: Callable[[], float], send: Callable[[bytes], None]
    ) -> None:
        """A way with nothing on it, on the running loop.

        Args:
            line: Where datagrams are held.
            clock: Tells the line's time [s]; must run as fast as the loop's.
            send: Hands a datagram to the network; an OSError is counted.
        """
        self.line = line
        self._clock, self._send = clock, send
        self._timer: asyncio.TimerHandle | None = None
        self._due: float | None = None

    def put(self, datagram: bytes) -> None:
        """Take one datagram in; at once out again if nothing delays it."""
        self.line.put(self._clock(), datagram)
        self._empty()

    def close(self) -> None:
        """Deliver nothing any more."""
        if self._timer is not None:
            self._timer.cancel()

    def _wake(self) -> None:
        self._due = None
        self._empty()

    def _empty(self) -> None:
        for datagram in self.line.take(self._clock()):
            try:
                self._send(datagram)
                self.line.counts.sent += 1
            except OSError:
                self.line.counts.unsent += 1
        due = self.line.next_due
        if due is not None and (self._due is None or due < self._due):
            self.close()
            wait = max(0.0, due - self._clock())
            self._timer = asyncio.get_running_loop().call_later(wait, self._wake)
            self._due = due
