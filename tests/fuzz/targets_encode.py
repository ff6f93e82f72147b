"""The writing side: whatever a client puts in, a packet that is read again, or a ProtocolError."""

import math
import struct

from demand import KEY, must, words
from motion_protocol import (
    Cue,
    DriverInputs,
    Mode,
    Motion,
    Preview,
    ProtocolError,
    TimedPreview,
    decode_cue,
    encode_cue,
)
from oracle_cue import read_cue

LARGEST = struct.unpack("<f", b"\xff\xff\x7f\x7f")[0]
# what rounds to the largest number still fits
EDGE = LARGEST + 2.0**103


def encode(data):
    """First byte: mode, key and which blocks; then doubles for the fields, in their order."""
    data = data.ljust(129, b"\x00")
    choice = data[0]
    values = struct.unpack_from("<16d", data, 1)
    motion = Motion(
        values[0:3],
        values[3:6],
        (values[6], values[7]) if choice & 4 else None,
        values[8],
        None if choice & 8 else values[9],
    )
    samples = (values[0:6],) * (data[120] % 43)
    preview = Preview(values[10], values[11], samples) if choice & 16 else None
    if preview is not None and data[121] % 2:
        instants = tuple(values[10] + k * values[11] for k in range(len(samples)))
        preview = TimedPreview(instants, samples)
    gear = data[1] if choice & 64 else 1
    driver = DriverInputs(*values[12:16], gear) if choice & 32 else None
    session, sequence = _integer(data[1:6]), _integer(data[9:14])
    key = KEY if choice & 128 else None
    times = _integer(data[17:26]), _integer(data[25:33])
    told = None if choice & 3 == 3 and choice & 8 else motion
    cue = Cue(session, sequence, *times, told, Mode(choice & 3), preview=preview, driver=driver)
    right = session < 1 << 32 and sequence < 1 << 32 and max(times) < 1 << 64
    used = [0.0]
    if told is not None:
        used += [*values[0:6], *(values[6:8] if choice & 4 else ()), values[8]]
        used += () if choice & 8 else values[9:10]
    if isinstance(preview, TimedPreview):
        right = right and _may_be_sent(preview.times)
    if preview is not None:
        used += values[10:12] if isinstance(preview, Preview) else ()
        right = right and 1 <= len(samples) <= 40
        used += values[0:6] if samples else ()
    if driver is not None:
        used += values[12:16]
        right = right and gear < 128
    right = right and all(math.isfinite(one) and abs(one) < EDGE for one in used)
    try:
        packet = encode_cue(cue, key)
    except ProtocolError as error:
        must(not right, f"not written without need: {error}")
        must(error.reason in ("field", "not_finite"), error.reason)
        words(error, error.field)
        return False
    assert right, "written in spite of what is in it"
    assert not read_cue(packet, key).wrongs
    assert encode_cue(decode_cue(packet, key), key) == packet, "read and written again it differs"
    return True


def _may_be_sent(instants):
    """As the byte table says: increasing tenths of a millisecond from 0 to 40000."""
    if not all(math.isfinite(one) and abs(one) < 1e9 for one in instants):
        return False
    units = [round(one * 1e4) for one in instants]
    return units == sorted(set(units)) and all(0 <= one <= 40000 for one in units)


def _integer(data):
    """Mostly small, at times one bit too long."""
    value = int.from_bytes(data, "little")
    return value >> 8 if data[-1] % 4 else value
