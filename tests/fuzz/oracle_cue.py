"""Which cue and status packets are to be taken: by hand from protocol/README.md, not from the code.

Nothing of `motion_protocol` is imported here, so that the two can convict each other.
"""

import hashlib
import hmac
import math
import struct
import zlib

CUE_TEXT = b"MCUE/1 4sBBBBHHB3xIIQQI HH 1:10fBB2x 2:H2x2f*6f 3:4fb3x"
STATUS_TEXT = b"MCST/1 4sBBBBHHB3xIIQQI HH 64:QQ5IfB3x"
MOTION = [
    "acceleration.x",
    "acceleration.y",
    "acceleration.z",
    "rates.p",
    "rates.q",
    "rates.r",
    "roll",
    "pitch",
    "yaw",
    "speed",
]
SAMPLE = ["ax", "ay", "az", "p", "q", "r"]
DRIVER = ["throttle", "brake", "clutch", "steering"]


class Read:
    """What a careful reader sees: what is wrong, or the values.

    Attributes:
        wrongs: Reasons that may be given for a refusal; empty = to be taken.
        floats: Every float of a known block by its name in messages.
        fields: Everything else that was read, by name.
        plain: True if a sender of this version writes exactly these bytes for these values.
    """

    def __init__(self):
        self.wrongs = set()
        self.floats = {}
        self.fields = {}
        self.plain = True

    def number(self, name, data, at):
        value = struct.unpack_from("<f", data, at)[0]
        self.floats[name] = value
        if not math.isfinite(value):
            self.wrongs.add("not_finite")
        return value

    def zero(self, data):
        self.plain = self.plain and not any(data)


def integer(data, at, size):
    return int.from_bytes(data[at : at + size], "little")


def read_cue(data, key):
    read = _frame(data, key, b"MCUE", CUE_TEXT)
    if read.wrongs:
        return read
    read.fields["mode"] = mode = data[12]
    read.fields["flags"] = integer(data, 10, 2) & 31
    read.zero([integer(data, 10, 2) & ~31])
    if mode > 3:
        read.wrongs.add("unknown_value")
    found = _blocks(read, data, {1: _motion, 2: _preview, 3: _driver, 4: _timed_preview})
    if found is None:
        return read
    if 1 not in found and mode != 3:
        read.wrongs.add("block_missing")
    # a sender writes motion, one preview, driver inputs; minor 1 only with a timed preview
    order = sorted(found, key=[1, 2, 4, 3].index)
    read.plain = read.plain and found == order and not {2, 4} <= set(found)
    read.plain = read.plain and data[5] == (1 if 4 in found else 0)
    return read


def read_status(data, key):
    read = _frame(data, key, b"MCST", STATUS_TEXT)
    if read.wrongs:
        return read
    read.zero(data[10:13])
    found = _blocks(read, data, {64: _state, 65: _notice})
    if found is not None and 64 not in found:
        read.wrongs.add("block_missing")
    # a server writes the state first; minor 1 only with a notice
    read.plain = read.plain and found == sorted(found or ())
    read.plain = read.plain and data[5] == (1 if 65 in (found or ()) else 0)
    return read


def _frame(data, key, magic, text):
    """Everything up to the signature; here the order of the refusals is told, so one is named."""
    read = Read()
    wrong = _frame_wrong(data, key, magic, text)
    if wrong:
        read.wrongs.add(wrong)
        return read
    read.zero([data[7], *data[13:16]])
    for name, at, size in (
        ("session", 16, 4),
        ("sequence", 20, 4),
        ("sim_time_ns", 24, 8),
        ("sender_time_ns", 32, 8),
    ):
        read.fields[name] = integer(data, at, size)
    return read


def _frame_wrong(data, key, magic, text):
    if not 44 <= len(data) <= 1200:
        return "size"
    if data[:4] != magic:
        return "byte_order" if data[3::-1] == magic else "magic"
    if data[4] != 1:
        return "version"
    if data[6] > 1:
        return "incompat"
    trailer = 16 * data[6]
    if len(data) != 44 + integer(data, 8, 2) + trailer:
        swapped = data[8] * 256 + data[9]
        return "byte_order" if len(data) == 44 + swapped + trailer else "length"
    end = len(data) - trailer
    if integer(data, 40, 4) != zlib.crc32(text + data[:40] + data[44:end]):
        return "checksum"
    if not trailer:
        return "" if key is None else "hmac_missing"
    if key is None:
        return "hmac_unexpected"
    told = signature(data[:end], key)
    return "" if told == data[end:] else "hmac_wrong"


def _blocks(read, data, known):
    """Walk the blocks; the known ones in their order, or None if the walk cannot go on."""
    at, end = 44, 44 + integer(data, 8, 2)
    found = []
    while at < end:
        if at + 4 > end or at + 4 + integer(data, at + 2, 2) > end:
            read.wrongs.add("block_truncated")
            return None
        kind, size = integer(data, at, 2), integer(data, at + 2, 2)
        if kind in known:
            if kind in found:
                read.wrongs.add("block_duplicate")
            else:
                known[kind](read, data[at + 4 : at + 4 + size])
            found.append(kind)
        else:
            read.plain = False
            if kind >= 0x8000:
                read.wrongs.add("block_unknown")
        at += 4 + size
    return found


def _motion(read, body):
    if len(body) != 44:
        read.wrongs.add("block_length")
        return
    values = [read.number(f"motion.{name}", body, 4 * i) for i, name in enumerate(MOTION)]
    reference, valid = body[40], body[41]
    if reference > 5:
        read.wrongs.add("unknown_value")
    read.fields |= {
        "acceleration": tuple(values[0:3]),
        "rates": tuple(values[3:6]),
        "attitude": (values[6], values[7]) if valid & 1 else None,
        "yaw": values[8] if valid & 2 else None,
        "speed": values[9] if valid & 4 else None,
        "reference": reference,
    }
    read.zero([valid & ~7, *body[42:44]])
    for bit, piece in ((1, body[24:32]), (2, body[32:36]), (4, body[36:40])):
        if not valid & bit:
            read.zero(piece)


def _preview(read, body):
    count = integer(body, 0, 2)
    if len(body) < 12:
        read.wrongs.add("block_length")
        return
    dt, start = (read.number(f"preview.{n}", body, at) for n, at in (("dt", 4), ("start", 8)))
    if not 1 <= count <= 40 or len(body) != 12 + 24 * count:
        read.wrongs.add("block_length")
        return
    read.zero(body[2:4])
    samples = _samples(read, body, 12, count, "preview")
    if "times" not in read.fields:
        read.fields |= {"dt": dt, "start": start, "samples": samples}


def _samples(read, body, begin, count, block):
    return tuple(
        tuple(
            read.number(f"{block}[{i}].{name}", body, begin + 24 * i + 4 * j)
            for j, name in enumerate(SAMPLE)
        )
        for i in range(count)
    )


def _timed_preview(read, body):
    """Of two previews this one counts."""
    count = integer(body, 0, 2)
    if len(body) < 4 or not 1 <= count <= 40 or len(body) != 4 + 26 * count:
        read.wrongs.add("block_length")
        return
    read.zero(body[2:4])
    samples = _samples(read, body, 4, count, "timed_preview")
    instants = [integer(body, 4 + 24 * count + 2 * i, 2) for i in range(count)]
    if instants != sorted(set(instants)) or instants[-1] > 40000:
        read.wrongs.add("unknown_value")
    for name in ("dt", "start"):
        read.fields.pop(name, None)
    read.fields |= {"times": tuple(one * 1e-4 for one in instants), "samples": samples}


def _driver(read, body):
    if len(body) != 20:
        read.wrongs.add("block_length")
        return
    for i, name in enumerate(DRIVER):
        read.fields[name] = read.number(f"driver.{name}", body, 4 * i)
    read.fields["gear"] = int.from_bytes(body[16:17], "little", signed=True)
    read.zero(body[17:20])


def _notice(read, body):
    if not 4 <= len(body) <= 244:
        read.wrongs.add("block_length")
        return
    kinds, text = integer(body, 0, 2), bytes(body[4:])
    read.zero(body[2:4])
    # an empty notice is none, and what is no UTF-8 is not written as it was read
    read.plain = read.plain and bool(kinds or text) and _is_utf8(text)
    read.fields |= {"notices": kinds, "notice_text": text.decode("utf-8", "replace")}


def _is_utf8(text):
    try:
        text.decode("utf-8")
    except UnicodeDecodeError:
        return False
    return True


def _state(read, body):
    if len(body) != 44:
        read.wrongs.add("block_length")
        return
    for name, at, size in (
        ("echo_sender_time_ns", 0, 8),
        ("receive_time_ns", 8, 8),
        ("echo_sequence", 16, 4),
        ("accepted_sequence", 20, 4),
        ("lost", 24, 4),
        ("reordered", 28, 4),
        ("rejected", 32, 4),
        ("state", 40, 1),
    ):
        read.fields[name] = integer(body, at, size)
    read.fields["scale"] = read.number("status.scale", body, 36)
    if body[40] > 8:
        read.wrongs.add("unknown_value")
    read.zero(body[41:44])


def signature(data, key):
    return hmac.new(key, data, hashlib.sha256).digest()[:16]
