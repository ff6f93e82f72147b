"""Instants at which the kernel received datagrams, on the monotonic clock.

A process reads its socket when it gets the processor: two datagrams that came a period apart may be
read together. Whoever judges a sender by its spacing needs the kernel's own stamp.
"""

from __future__ import annotations

import socket
import struct
import sys
import time
from typing import Any, Final

_SO_TIMESTAMPNS: Final = 35
_TIMESPEC: Final = struct.Struct("@ll")
_ROOM: Final = socket.CMSG_SPACE(_TIMESPEC.size) if hasattr(socket, "CMSG_SPACE") else 0
_ATTEMPTS: Final = 5
_TIGHT_NS: Final = 5_000


class StampingSocket(socket.socket):
    """A UDP socket that knows when the kernel received the datagram read last.

    Attributes:
        is_stamping: Whether the kernel stamps; without it `arrived_ns` is the instant of reading.
        arrived_ns: When the newest datagram came, CLOCK_MONOTONIC [ns].
    """

    def __init__(self, family: int) -> None:
        """Open an unbound socket of this address family."""
        super().__init__(family, socket.SOCK_DGRAM)
        self.is_stamping = False
        self.arrived_ns = 0
        if sys.platform == "linux":
            try:
                self.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
            except OSError:
                return
            self.is_stamping = True

    def recvfrom(self, bufsize: int, flags: int = 0) -> tuple[bytes, Any]:
        """Read one datagram, and take note of when it came."""
        if not self.is_stamping:
            found = super().recvfrom(bufsize, flags)
            self.arrived_ns = time.monotonic_ns()
            return found
        data, ancillary, _, address = self.recvmsg(bufsize, _ROOM, flags)
        wall_minus_monotonic = _clock_offset_ns()
        self.arrived_ns = time.monotonic_ns()
        for level, kind, content in ancillary:
            if level == socket.SOL_SOCKET and kind == _SO_TIMESTAMPNS:
                seconds, nanoseconds = _TIMESPEC.unpack(content[: _TIMESPEC.size])
                self.arrived_ns = seconds * 1_000_000_000 + nanoseconds - wall_minus_monotonic
        return data, address


def bound_socket(address: tuple[str, int]) -> StampingSocket:
    """Open a stamping socket at an address.

    Raises:
        OSError: It cannot be bound.
    """
    opened = StampingSocket(socket.AF_INET6 if ":" in address[0] else socket.AF_INET)
    try:
        opened.bind(address)
    except OSError:
        opened.close()
        raise
    return opened


def _clock_offset_ns() -> int:
    """CLOCK_REALTIME minus CLOCK_MONOTONIC; both run at one rate, so that only a step changes it.

    Read until nothing came between the two readings, or a few times.
    """
    best, offset = 1 << 62, 0
    for _ in range(_ATTEMPTS):
        before = time.monotonic_ns()
        wall = time.time_ns()
        took = time.monotonic_ns() - before
        if took < best:
            best, offset = took, wall - before - took // 2
        if took < _TIGHT_NS:
            break
    return offset
