"""The status: what the server answers to a client, about ten times a second."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Final

from .errors import BlockDuplicateError, BlockLengthError, BlockMissingError, UnknownValueError
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


def encode_status(status: Status, key: bytes | None = None) -> bytes:
    """Write a status as one datagram, signed if there is a key.

    Raises:
        NotFiniteError: The scale is NaN or infinite.
        FieldError: A value does not fit its field.
    """
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
        block(STATUS, body),
        key,
        flags=0,
        mode=0,
        session=status.session,
        sequence=status.sequence,
        sim_time_ns=status.sim_time_ns,
        sender_time_ns=status.send_time_ns,
    )


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
    for _, offset, length in blocks(data, frame.end, _KNOWN):
        if values is not None:
            raise BlockDuplicateError(
                f"block {STATUS} appears again at byte {offset - 4}; each block may appear once"
            )
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
    )


_STATES: Final = tuple(PlatformState)
_KNOWN: Final = frozenset({STATUS})
