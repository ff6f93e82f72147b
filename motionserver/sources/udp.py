"""A UDP input: drained a bounded number of datagrams per tick, so a flood cannot hold the loop."""

from __future__ import annotations

import contextlib
import socket
import time
from typing import Final

DRAIN: Final = 64
"""Datagrams read per tick."""
LARGEST: Final = 2048
"""Bytes read of a datagram; what is longer is refused by its size."""
BUFFER: Final = 65536
"""Receive buffer [bytes]: small, because a full one drops the newest packet."""


class UdpInput:
    """One bound socket."""

    def __init__(self, host: str, port: int) -> None:
        """Bind.

        Raises:
            OSError: The address is in use or not ours.
        """
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
        try:
            self._socket.bind((host, port))
        except OSError:
            self._socket.close()
            raise
        self.address = self._socket.getsockname()[:2]
        self._peers: dict[str, tuple[str, int]] = {}

    def drain(self) -> list[tuple[bytes, str, int]]:
        """Datagrams that wait, at most `DRAIN`: bytes, sender as text, arrival [ns]."""
        out: list[tuple[bytes, str, int]] = []
        for _ in range(DRAIN):
            try:
                data, peer = self._socket.recvfrom(LARGEST)
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
                self._socket.sendto(data, peer)

    def close(self) -> None:
        """Stop listening."""
        self._socket.close()
