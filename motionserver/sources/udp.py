"""A UDP input: drained a bounded number of datagrams per tick, so a flood cannot hold the loop."""

from __future__ import annotations

import contextlib
import socket
import time
from typing import Final

DRAIN: Final = 96
"""Datagrams read per tick: more than the buffer holds, so that the newest is among them."""
LARGEST: Final = 2048
"""Bytes read of a datagram; what is longer is refused by its size."""
BUFFER: Final = 32768
"""Receive buffer [bytes], 78 small datagrams, 28 of 1200 bytes: a full one drops the newest."""


class UdpInput:
    """One bound socket."""

    def __init__(self, host: str, port: int) -> None:
        """Bind.

        Raises:
            OSError: The address is in use or not ours.
        """
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self.socket = socket.socket(family, socket.SOCK_DGRAM)
        self.socket.setblocking(False)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
        try:
            self.socket.bind((host, port))
        except OSError:
            self.socket.close()
            raise
        self.address = self.socket.getsockname()[:2]
        self._peers: dict[str, tuple[str, int]] = {}

    def drain(self) -> list[tuple[bytes, str, int]]:
        """Datagrams that wait, at most `DRAIN`: bytes, sender as text, arrival [ns]."""
        out: list[tuple[bytes, str, int]] = []
        for _ in range(DRAIN):
            try:
                data, peer = self.socket.recvfrom(LARGEST)
            except (BlockingIOError, ConnectionError):
                break
            name = f"{peer[0]}:{peer[1]}"
            if len(self._peers) > DRAIN:
                self._peers.clear()
            self._peers[name] = peer
            out.append((data, name, time.monotonic_ns()))
        return out

    def reply(self, name: str, data: bytes) -> None:
        """Send to a peer that was heard; what cannot be sent is lost."""
        peer = self._peers.get(name)
        if peer is not None:
            with contextlib.suppress(OSError):
                self.socket.sendto(data, peer)

    def close(self) -> None:
        """Stop listening."""
        self.socket.close()
