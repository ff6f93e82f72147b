"""Datagrams on their way through a flawed link: held until they are due, in bounded room."""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from typing import Final

from .datagram import own_bytes
from .flawed_link import FlawedLink, LinkCounts, LinkFlaws

MOST_HELD: Final = 4096
"""Datagrams that may be on their way at the same time."""

MOST_BYTES: Final = 1 << 20
"""Bytes that may be on their way at the same time."""


@dataclass(slots=True)
class WayCounts(LinkCounts):
    """What happened on a link and behind it.

    ``received + duplicated == lost + dropped + sent + unsent`` and those still on their way.

    Attributes:
        dropped: Copies for which there was no room.
        sent: Copies handed to the network.
        unsent: Copies that the network refused.
    """

    dropped: int = 0
    sent: int = 0
    unsent: int = 0


class DelayLine:
    """A flawed link with its datagrams under way; pure, time comes from outside.

    Attributes:
        counts: What happened so far.
        link: The link; its flaws may be replaced at any time.
    """

    def __init__(
        self, flaws: LinkFlaws | None = None, *, seed: int = 0, counts: WayCounts | None = None
    ) -> None:
        """A line with nothing on it.

        Args:
            flaws: What is wrong with its link.
            seed: Of the link's random generator.
            counts: Where to count; by default the line's own.
        """
        self.counts = WayCounts() if counts is None else counts
        self.link = FlawedLink(flaws, seed=seed, counts=self.counts)
        self._held: list[tuple[float, int, bytes]] = []
        self._order = 0
        self._bytes = 0

    @property
    def next_due(self) -> float | None:
        """When the next datagram arrives [s]; None if none is on its way."""
        return self._held[0][0] if self._held else None

    def __len__(self) -> int:
        """Datagrams on their way."""
        return len(self._held)

    def put(self, now: float, datagram: bytes) -> None:
        """Send a datagram at ``now`` [s]; a full line drops it, because the older came first."""
        for arrival in self.link.carry(now, datagram):
            size = len(arrival.datagram)
            if len(self._held) >= MOST_HELD or self._bytes + size > MOST_BYTES:
                self.counts.dropped += 1
                continue
            held = own_bytes(arrival.datagram)
            heapq.heappush(self._held, (now + arrival.delay, self._order, held))
            self._order += 1
            self._bytes += size

    def take(self, now: float) -> list[bytes]:
        """Datagrams that have arrived by ``now`` [s], in the order of their arrival."""
        arrived = []
        while self._held and self._held[0][0] <= now:
            datagram = heapq.heappop(self._held)[2]
            self._bytes -= len(datagram)
            arrived.append(datagram)
        return arrived
