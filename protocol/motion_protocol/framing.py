"""The frame of every packet: header, checksum, signature, typed blocks."""

from __future__ import annotations

import hashlib
import hmac
import zlib
from collections.abc import Iterator
from typing import Final, NamedTuple

from .errors import (
    BlockTruncatedError,
    BlockUnknownError,
    ByteOrderError,
    ChecksumError,
    HmacMissingError,
    HmacUnexpectedError,
    HmacWrongError,
    IncompatError,
    LengthError,
    MagicError,
    SizeError,
    VersionError,
)
from .layout import Layout

MAX_DATAGRAM: Final = 1200
"""Longest packet, trailer included [bytes]: below every common path MTU, so never fragmented."""

VERSION: Final = (1, 0)
"""Major and minor version this module writes. It reads every minor of this major."""

INCOMPAT_SIGNED: Final = 0x01
"""Incompatibility flag: a 16-byte HMAC trailer follows the payload."""

HMAC_SIZE: Final = 16
BLOCK_CRITICAL: Final = 0x8000
"""Bit of a block's type: a receiver that does not know the block must refuse the packet."""

HEADER: Final = Layout(
    "header",
    (
        ("magic", "4s"),
        ("version_major", "B"),
        ("version_minor", "B"),
        ("incompat", "B"),
        ("compat", "B"),
        ("payload_length", "H"),
        ("flags", "H"),
        ("mode", "B"),
        ("", "3x"),
        ("session", "I"),
        ("sequence", "I"),
        ("sim_time_ns", "Q"),
        ("sender_time_ns", "Q"),
        ("crc", "I"),
    ),
)
BLOCK_HEAD: Final = Layout("block", (("type", "H"), ("length", "H")))
_CRC_OFFSET: Final = HEADER.size - 4


class Kind(NamedTuple):
    """One kind of packet: its mark and the seed that ties a checksum to its byte layout."""

    magic: bytes
    crc_seed: int


class Frame(NamedTuple):
    """The header's fields that differ from packet to packet, and where the payload ends."""

    flags: int
    mode: int
    session: int
    sequence: int
    sim_time_ns: int
    sender_time_ns: int
    end: int
    is_signed: bool


def kind(magic: bytes, layout: bytes) -> Kind:
    """Name a kind of packet.

    Args:
        magic: The four bytes it begins with.
        layout: The text of its byte layout. Its CRC-32 seeds the checksum, so two programs
            that disagree on the layout refuse each other's packets.
    """
    return Kind(magic, zlib.crc32(layout))


def block(block_type: int, body: bytes) -> bytes:
    """Put the four-byte head in front of a block's body."""
    return BLOCK_HEAD.pack(block_type, len(body)) + body


def sign(data: bytes, key: bytes) -> bytes:
    """Compute the signature: HMAC-SHA256 [RFC 2104], first 16 bytes."""
    return hmac.digest(key, data, hashlib.sha256)[:HMAC_SIZE]


def close_frame(
    kind: Kind,
    payload: bytes,
    key: bytes | None,
    *,
    flags: int,
    mode: int,
    session: int,
    sequence: int,
    sim_time_ns: int,
    sender_time_ns: int,
    minor: int = VERSION[1],
) -> bytes:
    """Write header, payload and, with a key, the signature.

    A packet bears the oldest minor version that describes all it contains.

    Raises:
        SizeError: The packet would exceed `MAX_DATAGRAM`.
        FieldError: A header value does not fit its field.
    """
    incompat = 0 if key is None else INCOMPAT_SIGNED
    size = HEADER.size + len(payload) + (0 if key is None else HMAC_SIZE)
    if size > MAX_DATAGRAM:
        raise SizeError(
            f"the packet would be {size} bytes, at most {MAX_DATAGRAM} are allowed; "
            f"send fewer preview samples"
        )
    head = HEADER.pack(
        kind.magic, VERSION[0], minor, incompat, 0, len(payload), flags, mode,
        session, sequence, sim_time_ns, sender_time_ns, 0,
    )[:_CRC_OFFSET]  # fmt: skip
    crc = zlib.crc32(payload, zlib.crc32(head, kind.crc_seed))
    data = head + crc.to_bytes(4, "little") + payload
    return data if key is None else data + sign(data, key)


def open_frame(kind: Kind, data: bytes, key: bytes | None) -> Frame:
    """Check everything about a packet that does not depend on its blocks.

    Args:
        kind: The kind that is expected here.
        data: The whole datagram.
        key: The shared key; None takes unsigned packets only, a key signed ones only.

    Raises:
        ProtocolError: The kinds from `SizeError` to `HmacUnexpectedError`.
    """
    if not HEADER.size <= len(data) <= MAX_DATAGRAM:
        raise SizeError(
            f"datagram of {len(data)} bytes; a packet has {HEADER.size} to {MAX_DATAGRAM}; "
            f"check that the sender speaks this protocol and sends one packet per datagram"
        )
    (
        magic, major, minor, incompat, _compat, length, flags, mode,
        session, sequence, sim_time_ns, sender_time_ns, crc,
    ) = HEADER.unpack(data, 0)  # fmt: skip
    if magic != kind.magic:
        raise _wrong_magic(kind, magic)
    if major != VERSION[0]:
        raise VersionError(
            f"protocol version {major}.{minor}; this receiver reads {VERSION[0]}.x; "
            f"use a sender and a server of the same major version"
        )
    if incompat & ~INCOMPAT_SIGNED:
        raise IncompatError(
            f"incompatibility flags {incompat:#04x} at byte 6; known is {INCOMPAT_SIGNED:#04x} "
            f"(signed); the sender uses a newer feature: switch it off or update the server"
        )
    end = HEADER.size + length
    expected = end + (HMAC_SIZE if incompat else 0)
    if expected != len(data):
        raise _wrong_length(length, expected, len(data), HMAC_SIZE if incompat else 0)
    found = zlib.crc32(data[HEADER.size : end], zlib.crc32(data[:_CRC_OFFSET], kind.crc_seed))
    if found != crc:
        raise ChecksumError(
            f"CRC-32 at byte {_CRC_OFFSET} is {crc:#010x}, computed {found:#010x}; the packet was "
            f"damaged, or its sender follows another byte layout or forgot the layout seed"
        )
    _check_signature(data, end, key, is_signed=bool(incompat))
    return Frame(
        flags, mode, session, sequence, sim_time_ns, sender_time_ns, end, bool(incompat)
    )  # fmt: skip


def blocks(data: bytes, end: int, known: frozenset[int]) -> Iterator[tuple[int, int, int]]:
    """Walk the typed blocks that are known here, skipping the optional unknown ones.

    Yields:
        Block type, offset of the body in the packet, length of the body [bytes].

    Raises:
        BlockTruncatedError: A block reaches beyond the payload.
        BlockUnknownError: An unknown block must be understood.
    """
    offset = HEADER.size
    while offset < end:
        body = offset + BLOCK_HEAD.size
        if body > end:
            raise BlockTruncatedError(
                f"{end - offset} bytes left at byte {offset}, a block's head takes "
                f"{BLOCK_HEAD.size}; correct the sender's block or payload length"
            )
        block_type, length = BLOCK_HEAD.struct.unpack_from(data, offset)
        if body + length > end:
            raise BlockTruncatedError(
                f"block {block_type:#06x} at byte {offset} claims {length} bytes, "
                f"{end - body} are left; correct the sender's block or payload length"
            )
        if block_type in known:
            yield block_type, body, length
        elif block_type & BLOCK_CRITICAL:
            raise BlockUnknownError(
                f"block {block_type:#06x} at byte {offset} must be understood (bit 15) and is not; "
                f"known are {sorted(known)}; update the server or leave the block out"
            )
        offset = body + length


def _wrong_magic(kind: Kind, magic: bytes) -> MagicError | ByteOrderError:
    if magic == kind.magic[::-1]:
        return ByteOrderError(
            f"the packet begins with {magic!r}, the mark {kind.magic!r} written backwards; "
            f"every field is little-endian: swap the bytes in the sender"
        )
    return MagicError(
        f"the datagram begins with {magic!r}, expected {kind.magic!r}; "
        f"check port and format of the sender"
    )


def _wrong_length(
    length: int, expected: int, size: int, trailer: int
) -> LengthError | ByteOrderError:
    swapped = int.from_bytes(length.to_bytes(2, "little"), "big")
    if HEADER.size + swapped + trailer == size:
        return ByteOrderError(
            f"the payload length {length} at byte 8 fits only with its bytes swapped ({swapped}); "
            f"every field is little-endian: swap the bytes in the sender"
        )
    return LengthError(
        f"the header announces a packet of {expected} bytes (payload {length}), "
        f"the datagram has {size}; send header, payload and trailer in one datagram"
    )


def _check_signature(data: bytes, end: int, key: bytes | None, *, is_signed: bool) -> None:
    if key is None:
        if is_signed:
            raise HmacUnexpectedError(
                "the packet is signed and no key is configured here; "
                "configure the sender's key, or switch signing off on both sides"
            )
        return
    if not is_signed:
        raise HmacMissingError(
            "the packet is not signed and a key is configured here; "
            "give the sender the same key file"
        )
    if not hmac.compare_digest(sign(data[:end], key), data[end:]):
        raise HmacWrongError(
            "the signature does not match the configured key; "
            "give sender and server the same key file"
        )
