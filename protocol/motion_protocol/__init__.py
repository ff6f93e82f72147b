"""The cue protocol: what a simulator says to the motion server, byte for byte."""

from .blocks import PREVIEW_MAX, DriverInputs, Motion, Preview, Reference, Sample, Vector3
from .cue import Cue, Flags, Mode, decode_cue, encode_cue
from .errors import (
    BlockDuplicateError,
    BlockLengthError,
    BlockMissingError,
    BlockTruncatedError,
    BlockUnknownError,
    ByteOrderError,
    ChecksumError,
    FieldError,
    HmacMissingError,
    HmacUnexpectedError,
    HmacWrongError,
    IncompatError,
    LengthError,
    MagicError,
    NotFiniteError,
    ProtocolError,
    SizeError,
    UnknownValueError,
    VersionError,
)
from .framing import MAX_DATAGRAM, VERSION
from .sequence import sequence_delta
from .status import (
    NOTICE_TEXT_MAX,
    Notices,
    PlatformState,
    Status,
    decode_status,
    encode_status,
)
from .timed_preview import TimedPreview, preview_times

DEFAULT_PORT = 4600
"""UDP port on which the server takes cues unless configured otherwise."""

__all__ = [
    "DEFAULT_PORT",
    "MAX_DATAGRAM",
    "NOTICE_TEXT_MAX",
    "PREVIEW_MAX",
    "VERSION",
    "BlockDuplicateError",
    "BlockLengthError",
    "BlockMissingError",
    "BlockTruncatedError",
    "BlockUnknownError",
    "ByteOrderError",
    "ChecksumError",
    "Cue",
    "DriverInputs",
    "FieldError",
    "Flags",
    "HmacMissingError",
    "HmacUnexpectedError",
    "HmacWrongError",
    "IncompatError",
    "LengthError",
    "MagicError",
    "Mode",
    "Motion",
    "NotFiniteError",
    "Notices",
    "PlatformState",
    "Preview",
    "ProtocolError",
    "Reference",
    "Sample",
    "SizeError",
    "Status",
    "TimedPreview",
    "UnknownValueError",
    "Vector3",
    "VersionError",
    "decode_cue",
    "decode_status",
    "encode_cue",
    "encode_status",
    "preview_times",
    "sequence_delta",
]
