"""The cue: what a simulator says the vehicle does, as one datagram."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum, IntFlag
from typing import Any, Final

from .blocks import (
    DRIVER,
    MOTION,
    PREVIEW,
    DriverInputs,
    Motion,
    Preview,
    pack_driver,
    pack_motion,
    pack_preview,
    unpack_driver,
    unpack_motion,
    unpack_preview,
)
from .errors import BlockDuplicateError, BlockMissingError, UnknownValueError
from .framing import VERSION, block, blocks, close_frame, kind, open_frame
from .timed_preview import (
    TIMED_PREVIEW,
    TIMED_PREVIEW_MINOR,
    TimedPreview,
    pack_timed_preview,
    unpack_timed_preview,
)

CUE_LAYOUT: Final = b"MCUE/1 4sBBBBHHB3xIIQQI HH 1:10fBB2x 2:H2x2f*6f 3:4fb3x"
CUE: Final = kind(b"MCUE", CUE_LAYOUT)


class Mode(IntEnum):
    """What the simulator is doing.

    DRIVE: the values are what the driver must feel. PAUSE: the game stands still, or shows a
    replay or a spectator's view; hold softly. TELEPORT: the vehicle was just put elsewhere; this
    and the values before do not belong together. BYE: the client leaves.
    """

    DRIVE = 0
    PAUSE = 1
    TELEPORT = 2
    BYE = 3


class Flags(IntFlag):
    """How the values are to be read. Bits that are not named here are ignored.

    GRAVITY_INCLUDED: `acceleration` is specific force. MEASURED_AT_PLATFORM: an IMU on the
    platform, not a vehicle. REPLAY: a recording is played back on purpose; moves as usual.
    STANDSTILL: the vehicle stands. CRASH: the vehicle is in a collision.
    """

    GRAVITY_INCLUDED = 0x0001
    MEASURED_AT_PLATFORM = 0x0002
    REPLAY = 0x0004
    STANDSTILL = 0x0008
    CRASH = 0x0010


NO_FLAGS: Final = Flags(0)


@dataclass(frozen=True, slots=True)
class Cue:
    """One packet from a simulator, or from an IMU on the platform.

    Attributes:
        session: Random number of this run of the client, 32 bits.
        sequence: Counts packets of the session, wraps at 2^32.
        sim_time_ns: The simulation's own time of the values [ns].
        sender_time_ns: The sender's monotonic clock when it sent [ns].
        motion: How the vehicle moves; None is possible only with `Mode.BYE`.
        mode: What the simulator is doing.
        flags: How the values are to be read.
        preview: What is expected next, if the sender knows, at equal distances or at instants of
            its own.
        driver: What the driver does at the controls, if the sender tells.
    """

    session: int
    sequence: int
    sim_time_ns: int
    sender_time_ns: int
    motion: Motion | None
    mode: Mode = Mode.DRIVE
    flags: Flags = NO_FLAGS
    preview: Preview | TimedPreview | None = None
    driver: DriverInputs | None = None


def encode_cue(cue: Cue, key: bytes | None = None) -> bytes:
    """Write a cue as one datagram.

    Args:
        cue: What to say. Values are rounded to 32-bit floats.
        key: Shared secret; with it the packet is signed.

    Raises:
        BlockMissingError: `motion` is None although the mode is not `BYE`.
        NotFiniteError: A number is NaN or infinite.
        FieldError: A value does not fit its field.
    """
    if cue.motion is None and cue.mode is not Mode.BYE:
        raise _motion_missing(cue.mode)
    payload = b"" if cue.motion is None else block(MOTION, pack_motion(cue.motion))
    minor = VERSION[1]
    if isinstance(cue.preview, TimedPreview):
        minor = TIMED_PREVIEW_MINOR
        payload += block(TIMED_PREVIEW, pack_timed_preview(cue.preview))
    elif cue.preview is not None:
        payload += block(PREVIEW, pack_preview(cue.preview))
    if cue.driver is not None:
        payload += block(DRIVER, pack_driver(cue.driver))
    return close_frame(
        CUE,
        payload,
        key,
        flags=cue.flags,
        mode=cue.mode,
        session=cue.session,
        sequence=cue.sequence,
        sim_time_ns=cue.sim_time_ns,
        sender_time_ns=cue.sender_time_ns,
        minor=minor,
    )


def decode_cue(data: bytes, key: bytes | None = None) -> Cue:
    """Read a datagram as a cue.

    Whether the values are plausible is not judged here, only that they are finite.

    Args:
        data: The whole datagram.
        key: Shared secret; None takes unsigned packets only, a key signed ones only.

    Raises:
        ProtocolError: The packet is refused; the subclass and its `reason` say why.
    """
    frame = open_frame(CUE, data, key)
    if frame.mode >= len(_MODES):
        raise UnknownValueError(
            f"mode at byte 12 is {frame.mode}; known are 0 drive, 1 pause, 2 teleport, 3 bye; "
            f"send one of these",
            field="mode",
        )
    found: dict[int, Any] = {}
    for block_type, offset, length in blocks(data, frame.end, _KNOWN):
        if block_type in found:
            raise BlockDuplicateError(
                f"block {block_type} appears again at byte {offset - 4}; "
                f"each block may appear once: send a packet per instant"
            )
        found[block_type] = _UNPACK[block_type](data, offset, length)
    mode = _MODES[frame.mode]
    motion = found.get(MOTION)
    if motion is None and mode is not Mode.BYE:
        raise _motion_missing(mode)
    return Cue(
        frame.session,
        frame.sequence,
        frame.sim_time_ns,
        frame.sender_time_ns,
        motion,
        mode,
        _FLAGS[frame.flags & _FLAGS_MASK],
        found.get(TIMED_PREVIEW) or found.get(PREVIEW),
        found.get(DRIVER),
    )


def _motion_missing(mode: Mode) -> BlockMissingError:
    return BlockMissingError(
        f"a cue of mode {mode.name.lower()} has no motion block (type {MOTION}); "
        f"only bye may omit it",
        field="motion",
    )


# Looking up is several times cheaper than calling an enumeration.
_MODES: Final = tuple(Mode)
_FLAGS_MASK: Final = 0x001F
_FLAGS: Final = tuple(Flags(bits) for bits in range(_FLAGS_MASK + 1))
_UNPACK: Final = {
    MOTION: unpack_motion,
    PREVIEW: unpack_preview,
    DRIVER: unpack_driver,
    TIMED_PREVIEW: unpack_timed_preview,
}
_KNOWN: Final = frozenset(_UNPACK)
