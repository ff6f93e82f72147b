"""Received datagrams that are kept longer than the call that received them."""

from __future__ import annotations


def own_bytes(datagram: bytes) -> bytes:
    """Copy a datagram out of the buffer it was received into.

    ``asyncio`` receives into 256 KiB and shrinks that in place: however short the datagram, a page
    of memory (4 KiB) stays with it for as long as it is kept.
    """
    return bytes(memoryview(datagram))
