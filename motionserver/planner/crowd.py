"""A crowd at an input's door: while there is one, the kernel lets the owner's packets in alone.

Without a crowd everybody is heard and refused by name, so that whoever wonders why his simulator
moves nothing is told. In a flood that would cost the owner his place in the buffer: then strangers,
and datagrams of no possible length, are dropped in the kernel and only counted.
"""

from __future__ import annotations

import socket
from collections.abc import Sequence
from typing import Final

from motionserver.telemetry.sieve import Peer, dropped, sieve, unsieve

MANY: Final = 48
"""Datagrams in one period that are a crowd; a simulator of 1000 Hz sends 17 in a slow one."""
REFUSED: Final = "none"
CALM_NS: Final = 2_000_000_000
"""How long it must be calm before everybody is heard again [ns]."""


class Crowd:
    """Watches one input.

    Args:
        link: Its socket.
        sizes: Shortest and longest datagram of its format [bytes].

    Attributes:
        dropped: Datagrams the kernel dropped here.
        filter: What it lets in, for people.
    """

    def __init__(self, link: socket.socket, sizes: tuple[int, int]) -> None:
        self._link = link
        self._sizes = sizes
        self._let_in: tuple[Peer, ...] | None = None
        self._crowded_ns: int | None = None
        self.dropped = 0
        self.filter = "open"

    def saw(self, heard: int, owners: Sequence[Peer], now_ns: int) -> None:
        """Note a period.

        Args:
            heard: Datagrams that were read in it.
            owners: Who owns something here: they are let in, whatever happens.
            now_ns: Now [ns].
        """
        lost = dropped(self._link)
        if heard + lost - self.dropped >= MANY:
            self._crowded_ns = now_ns
        self.dropped = lost
        if self._crowded_ns is None:
            return
        if now_ns - self._crowded_ns > CALM_NS:
            self._crowded_ns = None
            self._let_in = None
            if not self.filter.startswith(REFUSED):
                self._say(unsieve(self._link), "open")
        elif (wanted := tuple(owners)) != self._let_in:
            # without an owner nobody can be preferred, but for those whose length is possible
            names = ", ".join(f"{host}:{port}" for host, port in wanted)
            self._say(sieve(self._link, wanted, *self._sizes), f"crowd: {names or 'all'} let in")
            self._let_in = wanted

    def _say(self, refusal: str, done: str) -> None:
        self.filter = f"{REFUSED}: {refusal}" if refusal else done
