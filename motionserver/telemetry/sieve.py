"""A sieve in the kernel: datagrams of strangers, or of no possible length, never reach a buffer.

Classic BPF needs no privilege. A connected socket would do for one peer, but it hears of one sender
only (a vehicle and a platform's sensor may share a port), and the network's complaints about a peer
that is away would come back as errors of the next send, which is then not sent.
"""

from __future__ import annotations

import ctypes
import ipaddress
import socket
import struct
import sys
from collections.abc import Sequence
from typing import Final

Peer = tuple[str, int]

MOST: Final = 65507
"""Longest payload of a datagram [bytes]."""
_ATTACH, _DETACH, _MEMINFO = 26, 27, 55
_LOAD_WORD, _LOAD_HALF, _LOAD_BYTE, _AND = 0x20, 0x28, 0x30, 0x54
_JUMP_EQUAL, _JUMP_ABOVE, _JUMP_AT_LEAST, _RETURN = 0x15, 0x25, 0x35, 0x06
_KEEP: Final = (_RETURN, 0, 0, 0xFFFFFFFF)
_DROP: Final = (_RETURN, 0, 0, 0)
_HEADER: Final = 8
"""Of UDP [bytes]: a filter sees the datagram from there on, the port of its sender first."""
_LENGTH: Final = 4
_NETWORK: Final = 0xFFF00000
"""Where the kernel lets a filter read the header of IP."""
_NINE: Final = struct.Struct("9I")
Instruction = tuple[int, int, int, int]


def sieve(link: socket.socket, peers: Sequence[Peer], least: int = 0, most: int = MOST) -> str:
    """Let datagrams through that have a possible length and come from one of the peers.

    Args:
        link: A bound UDP socket; what already waits in it stays.
        peers: Address and port of each; none lets everybody through.
        least: Shortest payload [bytes].
        most: Longest payload [bytes].

    Returns:
        "" if the kernel does it, else why not.
    """
    try:
        program = sieve_program(peers, least, most)
    except ValueError as error:
        return str(error)
    code = b"".join(struct.pack("HBBI", *line) for line in program)
    buffer = ctypes.create_string_buffer(code, len(code))
    return _ask(link, _ATTACH, struct.pack("HP", len(program), ctypes.addressof(buffer)))


def unsieve(link: socket.socket) -> str:
    """Let everything through again; "" or why not."""
    return _ask(link, _DETACH, struct.pack("i", 0))


def dropped(link: socket.socket) -> int:
    """Datagrams that the kernel dropped on this socket: sieved, or no room; 0 if it cannot say."""
    try:
        found = link.getsockopt(socket.SOL_SOCKET, _MEMINFO, _NINE.size)
    except OSError:
        return 0
    return int(_NINE.unpack(found)[8]) if len(found) == _NINE.size else 0


def sieve_program(peers: Sequence[Peer], least: int, most: int) -> list[Instruction]:
    """The filter's instructions: code, jump if true, jump if false, operand."""
    lines: list[Instruction] = [
        (_LOAD_HALF, 0, 0, _LENGTH),
        (_JUMP_AT_LEAST, 0, 1, least + _HEADER),
        (_JUMP_ABOVE, 0, 1, most + _HEADER),
        _DROP,
    ]
    if not peers:
        return [*lines, _KEEP]
    for host, port in peers:
        lines += _from_peer(host, port)
    return [*lines, _DROP]


def _from_peer(host: str, port: int) -> list[Instruction]:
    """Keep what comes from this peer; fall through to what follows otherwise."""
    address = ipaddress.ip_address(host.partition("%")[0])
    if isinstance(address, ipaddress.IPv6Address):
        # a socket for both hears old senders under such a name
        address = address.ipv4_mapped or address
    first, version = (12, 0x40) if address.version == 4 else (8, 0x60)
    words = struct.unpack(f">{len(address.packed) // 4}I", address.packed)
    wanted = [(_LOAD_WORD, _NETWORK + first + 4 * i, word) for i, word in enumerate(words)]
    wanted.append((_LOAD_HALF, 0, port))
    lines: list[Instruction] = [(_LOAD_BYTE, 0, 0, _NETWORK), (_AND, 0, 0, 0xF0)]
    # every comparison that fails leaves for the line behind this block
    left = 2 * len(wanted) + 1
    lines.append((_JUMP_EQUAL, 0, left, version))
    for load, where, value in wanted:
        left -= 2
        lines += [(load, 0, 0, where), (_JUMP_EQUAL, 0, left, value)]
    return [*lines, _KEEP]


def _ask(link: socket.socket, option: int, value: bytes) -> str:
    if sys.platform != "linux":
        return f"{sys.platform} has no socket filter"
    try:
        link.setsockopt(socket.SOL_SOCKET, option, value)
    except OSError as error:
        return f"the kernel refuses a socket filter ({error.strerror})"
    return ""
