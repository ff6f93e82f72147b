"""Strangers who send as many datagrams as they are told, many with one call to the kernel.

Run as ``python -m motionserver.evaluate.bench.flooder PORT RATE_HZ SECONDS``.
"""

from __future__ import annotations

import ctypes
import os
import socket
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any, Final

from motionserver.evaluate.bench.processes import say

SENDERS: Final = 8
"""Strangers, each with a port of his own."""
SIZE: Final = 96
"""Of a datagram [bytes], as long as a cue may be."""
STEP: Final = 0.001
"""Between two calls [s]."""


class _Vector(ctypes.Structure):
    _fields_ = (("base", ctypes.c_void_p), ("length", ctypes.c_size_t))


class _Header(ctypes.Structure):
    _fields_ = (
        ("name", ctypes.c_void_p),
        ("name_length", ctypes.c_uint32),
        ("vectors", ctypes.c_void_p),
        ("vector_count", ctypes.c_size_t),
        ("control", ctypes.c_void_p),
        ("control_length", ctypes.c_size_t),
        ("flags", ctypes.c_int),
    )


class _Message(ctypes.Structure):
    _fields_ = (("header", _Header), ("sent", ctypes.c_uint32))


def flood(port: int, rate_hz: float, seconds: float) -> dict[str, float]:
    """Send to a port of 127.0.0.1.

    Args:
        port: Where to.
        rate_hz: Datagrams per second, all strangers together.
        seconds: How long [s].

    Returns:
        How many were sent, and how many per second.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    batch = max(1, round(rate_hz * STEP))
    body = ctypes.create_string_buffer(os.urandom(SIZE), SIZE)
    vector = _Vector(ctypes.addressof(body), SIZE)
    messages = (_Message * batch)()
    for message in messages:
        message.header.vectors, message.header.vector_count = ctypes.addressof(vector), 1
    sent = calls = 0
    with ExitStack() as stack:
        links = [stack.enter_context(link) for link in _strangers(port)]
        begun = due = time.monotonic()
        while due - begun < seconds:
            link = links[calls % len(links)]
            calls += 1
            # a refused datagram ends the call early; the others come with the next one
            done = libc.sendmmsg(link.fileno(), ctypes.byref(messages), batch, 0)
            sent += max(0, done)
            due += batch / rate_hz
            time.sleep(max(0.0, due - time.monotonic()))
        took = time.monotonic() - begun
    return {"sent": sent, "per_s": sent / took}


def _strangers(port: int) -> Iterator[socket.socket]:
    for _ in range(SENDERS):
        link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        link.connect(("127.0.0.1", port))
        yield link


def main(arguments: list[str]) -> int:
    """Flood, and tell."""
    found: dict[str, Any] = flood(int(arguments[0]), float(arguments[1]), float(arguments[2]))
    say(found)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
