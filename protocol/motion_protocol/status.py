"""The status: what the server answers to a client, about ten times a second."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum, IntFlag
from typing import Any, Final

from .errors import (
    BlockDuplicateError,
    BlockLengthError,
    BlockMissingError,
    FieldError,
    UnknownValueError,
)
from .framing import block, blocks, close_frame, kind, open_frame
from .layout import Layout

STATUS: Final = 64
STATUS_LAYOUT: Final = b"MCST/1 4sBBBBHHB3xIIQQI HH 64:QQ5IfB3x"
STATUS_KIND: Final = kind(b"MCST", STATUS_LAYOUT)
BODY: Final = Layout(
    "status",
    (
        ("echo_sender_time_ns", "Q"),
        ("receive_time_ns", "Q"),
        ("echo_sequence", "I"),
        ("accepted_sequence", "I"),
        ("lost", "I"),
        ("reordered", "I"),
        ("rejected", "I"),
        ("scale", "f"),
        ("state", "B"),
        ("", "3x"),
    ),
)


NOTICE: Final = 65
NOTICE_MINOR: Final = 1
"""Minor version that brought the notice block."""
NOTICE_HEAD: Final = Layout("notice", (("kinds", "H"), ("", "2x")))
NOTICE_TEXT_MAX: Final = 240
"""Longest text of a notice [bytes of UTF-8]."""


class Notices(IntFlag):
    """What the server finds wrong with this client's cues. Unknown bits may be set."""

    NONE = 0
    SENDER_TIME = 0x0001
    """The sender time is no clock in nanoseconds; it is ignored."""
    TOO_SLOW = 0x0002
    """Too few packets a second to drive a platform."""
    VALUES = 0x0004
    """Values contradict one another, or what a vehicle that stands feels: no drive begins."""
    OUT_OF_RANGE = 0x0008
    """Packets are refused because of a value beyond its range."""
    BAD_SHARE = 0x0010
    """So many packets are bad that the others do not count either."""


class PlatformState(IntEnum):
    """The motion state of the platform, in the order of the server's state table."""

    OFFLINE = 0
    PARKED = 1
    RAISING = 2
    READY = 3
    RUN = 4
    HOLD = 5
    PARKING = 6
    FAULT = 7
    SAFE = 8


@dataclass(frozen=True, slots=True)
class Status:
    """One answer of the server to one client.

    With the client's own time of arrival the first four instants are NTP's four timestamps
    [RFC 5905, section 8].

    Attributes:
        session: The client's session this answer is for.
        sequence: Counts the answers to this session, wraps at 2^32.
        sim_time_ns: Simulation time of the newest accepted cue [ns].
        send_time_ns: The server's monotonic clock when it sent this [ns].
        echo_sender_time_ns: `sender_time_ns` of the cue that is echoed [ns].
        receive_time_ns: The server's monotonic clock when that cue arrived [ns].
        echo_sequence: Sequence of the cue that is echoed.
        accepted_sequence: Newest sequence that was accepted.
        lost: Sequence numbers that never came.
        reordered: Cues that came after a later one.
        rejected: Cues of this session that were refused.
        scale: Scale applied to the motion now, 0 to 1.
        state: The platform's motion state.
        notices: What the server finds wrong with this client's cues.
        notice_text: The same in a sentence, at most `NOTICE_TEXT_MAX` bytes of UTF-8.
    """

    session: int
    sequence: int
    sim_time_ns: int
    send_time_ns: int
    echo_sender_time_ns: int
    receive_time_ns: int
    echo_sequence: int
    accepted_sequence: int
    lost: int
    reordered: int
    rejected: int
    scale: float
    state: PlatformState
    notices: Notices = Notices.NONE
    notice_text: str = ""


def encode_status(status: Status, key: bytes | None = None) -> bytes:
    """Write a status as one datagram, signed if there is a key.

    Raises:
        NotFiniteError: The scale is NaN or infinite.
        FieldError: A value does not fit its field.
    """
    has_notice = bool(status.notices or status.notice_text)
    body = BODY.pack(
        status.echo_sender_time_ns,
        status.receive_time_ns,
        status.echo_sequence,
        status.accepted_sequence,
        status.lost,
        status.reordered,
        status.rejected,
        status.scale,
        status.state,
    )
    return close_frame(
        STATUS_KIND,
        block(STATUS, body) + (_notice(status) if has_notice else b""),
        key,
        minor=NOTICE_MINOR if has_notice else 0,
        flags=0,
        mode=0,
        session=status.session,
        sequence=status.sequence,
        sim_time_ns=status.sim_time_ns,
        sender_time_ns=status.send_time_ns,
    )


def _notice(status: Status) -> bytes:
    text = status.notice_text.encode()
    if len(text) > NOTICE_TEXT_MAX:
        raise FieldError(
            f"notice.text has {len(text)} bytes, at most {NOTICE_TEXT_MAX} fit: shorten it",
            field="notice.text",
        )
    return block(NOTICE, NOTICE_HEAD.pack(status.notices) + text)


def decode_status(data: bytes, key: bytes | None = None) -> Status:
    """Read a datagram as a status.

    Args:
        data: The whole datagram.
        key: Shared secret; None takes unsigned packets only, a key signed ones only.

    Raises:
        ProtocolError: The packet is refused; the subclass and its `reason` say why.
    """
    frame = open_frame(STATUS_KIND, data, key)
    values: tuple[Any, ...] | None = None
    notice: tuple[Notices, str] | None = None
    for block_type, offset, length in blocks(data, frame.end, _KNOWN):
        if (values if block_type == STATUS else notice) is not None:
            raise BlockDuplicateError(
                f"block {block_type} appears again at byte {offset - 4}; each block may appear once"
            )
        if block_type == NOTICE:
            notice = _read_notice(data, offset, length)
            continue
        if length != BODY.size:
            raise BlockLengthError(
                f"the status block at byte {offset} has {length} bytes, expected {BODY.size}; "
                f"a changed layout needs a new block type",
                field="status",
            )
        values = BODY.unpack(data, offset)
    if values is None:
        raise BlockMissingError(f"the packet has no status block (type {STATUS})", field="status")
    echoed_ns, received_ns, echoed, accepted, lost, reordered, rejected, scale, state = values
    if state >= len(_STATES):
        raise UnknownValueError(
            f"status.state is {state}; known are 0 to {len(_STATES) - 1}; update this client",
            field="status.state",
        )
    return Status(
        frame.session,
        frame.sequence,
        frame.sim_time_ns,
        frame.sender_time_ns,
        echoed_ns,
        received_ns,
        echoed,
        accepted,
        lost,
        reordered,
        rejected,
        scale,
        _STATES[state],
        *(notice or ()),
    )


def _read_notice(data: bytes, offset: int, length: int) -> tuple[Notices, str]:
    if not NOTICE_HEAD.size <= length <= NOTICE_HEAD.size + NOTICE_TEXT_MAX:
        raise BlockLengthError(
            f"the notice block at byte {offset} has {length} bytes, expected {NOTICE_HEAD.size} "
            f"to {NOTICE_HEAD.size + NOTICE_TEXT_MAX}; correct the server's text",
            field="notice",
        )
    (kinds,) = NOTICE_HEAD.unpack(data, offset)
    text = data[offset + NOTICE_HEAD.size : offset + length]
    return Notices(kinds), text.decode("utf-8", "replace")


_STATES: Final = tuple(PlatformState)
_KNOWN: Final = frozenset({STATUS, NOTICE})
