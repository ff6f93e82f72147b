"""Everything that can be wrong with a packet, one class per kind, one tree.

ProtocolError
|- SizeError             size             too short for a header, or above the datagram limit
|- MagicError            magic            not this protocol, or the other kind of packet
|- ByteOrderError        byte_order       this protocol, written big-endian
|- VersionError          version          another major version
|- IncompatError         incompat         needs a feature this receiver does not know
|- LengthError           length           header and datagram disagree on the length
|- ChecksumError         checksum         damaged on the way, or another byte layout
|- HmacMissingError      hmac_missing     unsigned, but this receiver holds a key
|- HmacWrongError        hmac_wrong       signed with another key, or altered
|- HmacUnexpectedError   hmac_unexpected  signed, but this receiver holds no key
|- BlockTruncatedError   block_truncated  a block reaches beyond the payload
|- BlockLengthError      block_length     a known block has a length it cannot have
|- BlockUnknownError     block_unknown    a block that must be understood is not known
|- BlockDuplicateError   block_duplicate  a known block appears twice
|- BlockMissingError     block_missing    a required block is absent
|- NotFiniteError        not_finite       NaN or infinity
|- UnknownValueError     unknown_value    an enumeration has no such value
`- FieldError            field            (encoding only) a value does not fit its field
"""

from __future__ import annotations

from typing import ClassVar


class ProtocolError(Exception):
    """A packet was refused, or could not be written.

    Attributes:
        reason: Short stable word for the kind, meant for counters.
        field: Dotted name of the offending field, where there is one.
    """

    reason: ClassVar[str]

    def __init__(self, message: str, *, field: str | None = None) -> None:
        super().__init__(message)
        self.field = field


class SizeError(ProtocolError):
    """The datagram is too short for a header, or longer than the protocol allows."""

    reason = "size"


class MagicError(ProtocolError):
    """The datagram does not begin with the mark of the expected packet."""

    reason = "magic"


class ByteOrderError(ProtocolError):
    """The packet is of this protocol but was written big-endian."""

    reason = "byte_order"


class VersionError(ProtocolError):
    """The packet has another major version."""

    reason = "version"


class IncompatError(ProtocolError):
    """The packet sets an incompatibility flag this receiver does not know."""

    reason = "incompat"


class LengthError(ProtocolError):
    """The payload length in the header does not match the datagram."""

    reason = "length"


class ChecksumError(ProtocolError):
    """The CRC-32 does not match the bytes."""

    reason = "checksum"


class HmacMissingError(ProtocolError):
    """The packet is not signed, but this receiver only takes signed ones."""

    reason = "hmac_missing"


class HmacWrongError(ProtocolError):
    """The signature does not match this receiver's key."""

    reason = "hmac_wrong"


class HmacUnexpectedError(ProtocolError):
    """The packet is signed, but this receiver holds no key to check it."""

    reason = "hmac_unexpected"


class BlockTruncatedError(ProtocolError):
    """A block, or its four-byte head, reaches beyond the payload."""

    reason = "block_truncated"


class BlockLengthError(ProtocolError):
    """A known block has a length or count it cannot have."""

    reason = "block_length"


class BlockUnknownError(ProtocolError):
    """A block marked as must-be-understood is not known here."""

    reason = "block_unknown"


class BlockDuplicateError(ProtocolError):
    """A known block appears more than once."""

    reason = "block_duplicate"


class BlockMissingError(ProtocolError):
    """A block this packet must have is absent."""

    reason = "block_missing"


class NotFiniteError(ProtocolError):
    """A number is NaN or infinite; `field` says which."""

    reason = "not_finite"


class UnknownValueError(ProtocolError):
    """An enumeration field holds a value without meaning; `field` says which."""

    reason = "unknown_value"


class FieldError(ProtocolError):
    """A value to be sent does not fit its field on the wire; `field` says which."""

    reason = "field"
