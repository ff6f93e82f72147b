"""A seeded mutator that knows where the fields of a packet lie and can make it whole again."""

import random
import re
import struct
from dataclasses import dataclass, field

FLOATS = [
    0x7FC00000, 0xFFC00001, 0x7F800001, 0x7F800000, 0xFF800000, 0x00000001, 0x807FFFFF, 0x00800000,
    0x7F7FFFFF, 0xFF7FFFFF, 0x80000000, 0x00000000, 0x3F800000, 0xBF800000, 0x42480000, 0x501502F9,
]  # fmt: skip
DOUBLES = [
    0x7FF8000000000000, 0xFFF8000000000001, 0x7FF0000000000001, 0x7FF0000000000000,
    0xFFF0000000000000, 1, 0x800FFFFFFFFFFFFF, 0x7FEFFFFFFFFFFFFF, 0x8000000000000000, 0,
    0x3FF0000000000000, 0xBF50624DD2F1A9FC, 0x40C3880000000000, 0x3F50624DD2F1A9FC,
]  # fmt: skip
SIZES = (0, 1, 25, 32, 40, 41, 44, 88, 92)
_TOKEN = re.compile(rb"[\w.+-]+|\s+|.", re.DOTALL)


@dataclass
class Shape:
    """What a format looks like.

    Attributes:
        fields: Offset and `struct` code with its byte order, of every field.
        mend: Lengths, checksum, signature made right again; None if there are none.
        tokens: Words of a text format, to be put in place of others; empty for binary formats.
        repeat: Offset, stride, count and code of a table within the packet.
    """

    fields: list = field(default_factory=list)
    mend: object = None
    tokens: tuple = ()
    repeat: tuple = ()


class Mutator:
    """Draws packets from seeds: whole ones, and ones with something done to them."""

    def __init__(self, shape, seeds, seed):
        self.shape = shape
        self.seeds = seeds
        self.rng = random.Random(seed)
        ways = [self._bits, self._bytes, self._cut, self._splice, self._move, self._more]
        if shape.fields:
            ways += [self._field] * 8 + [self._swap]
        if shape.tokens:
            ways = [self._bits, self._cut, self._splice, self._more] + [self._token] * 9
        self._ways = ways

    def draw(self):
        rng = self.rng
        dice = rng.random()
        if dice < 0.02:
            return rng.choice(self.seeds)
        if dice < 0.04:
            return rng.randbytes(
                rng.choice((0, 1, 25, 32, 40, 41, 44, 88, 92, rng.randrange(1300)))
            )
        return self.change(rng.choice(self.seeds), 1 if dice < 0.7 else rng.randrange(2, 7))

    def change(self, packet, times):
        """Do so many things to a packet, and make it whole again, mostly."""
        data, rng = bytearray(packet), self.rng
        for _ in range(times):
            data = rng.choice(self._ways)(data)
        if self.shape.mend is not None and rng.random() < 0.75:
            data = self.shape.mend(data, rng)
        return bytes(data)

    def _bits(self, data):
        for _ in range(self.rng.choice((1, 1, 1, 2, 8))):
            if data:
                data[self.rng.randrange(len(data))] ^= 1 << self.rng.randrange(8)
        return data

    def _bytes(self, data):
        for _ in range(self.rng.choice((1, 1, 4))):
            if data:
                data[self.rng.randrange(len(data))] = self.rng.choice((0, 1, 127, 128, 254, 255))
        return data

    def _cut(self, data):
        if self.rng.random() < 0.5:
            return data[: self.rng.randrange(len(data) + 1)]
        start = self.rng.randrange(len(data) + 1)
        del data[start : start + self.rng.choice((1, 1, 2, 4, 12, 24, 100))]
        return data

    def _splice(self, data):
        other = self.rng.choice(self.seeds)
        if self.rng.random() < 0.5:
            at = self.rng.randrange(min(len(data), len(other)) + 1)
            return data[:at] + other[at:]
        start = self.rng.randrange(len(other) + 1)
        at = self.rng.randrange(len(data) + 1)
        data[at:at] = other[start : start + self.rng.choice((1, 4, 24, 48, 400))]
        return data

    def _move(self, data):
        start = self.rng.randrange(len(data) + 1)
        piece = data[start : start + self.rng.choice((4, 8, 24, 48))]
        at = self.rng.randrange(len(data) + 1)
        data[at : at + len(piece)] = piece
        return data

    def _more(self, data):
        return data + self.rng.randbytes(self.rng.choice((1, 1, 4, 16, 48, 1200)))

    def _pick(self, data):
        """A field that lies within the packet: offset and code; None if none does."""
        repeat = self.shape.repeat
        if repeat and self.rng.random() < 0.5:
            start, stride, code = repeat
            rows = (len(data) - start) // stride
            if rows > 0:
                return start + stride * self.rng.randrange(rows), code
        at, code = self.rng.choice(self.shape.fields)
        return (at, code) if at + struct.calcsize(code) <= len(data) else None

    def _field(self, data):
        picked = self._pick(data)
        if picked is None:
            return data
        (at, code), rng = picked, self.rng
        size = struct.calcsize(code)
        order = "big" if code[0] == ">" else "little"
        if code[1] in "fd":
            value = rng.choice(FLOATS if size == 4 else DOUBLES)
            if rng.random() < 0.3:
                value = rng.getrandbits(8 * size)
        else:
            top = 1 << 8 * size
            now = int.from_bytes(data[at : at + size], order)
            edges = (0, 1, now + 1, now - 1, now ^ 1 << rng.randrange(8 * size), top - 1, top >> 1)
            value = (
                rng.choice((*edges, (top >> 1) - 1, rng.randrange(48), rng.randrange(top))) % top
            )
        data[at : at + size] = value.to_bytes(size, order)
        return data

    def _swap(self, data):
        picked = self._pick(data)
        if picked is not None:
            at, code = picked
            size = struct.calcsize(code)
            data[at : at + size] = data[at : at + size][::-1]
        return data

    def _token(self, data):
        """Put a word of the format in place of another, drop one, or copy a line."""
        rng = self.rng
        if rng.random() < 0.2:
            lines = bytes(data).split(b"\n")
            picked = rng.choice(lines)
            which = rng.randrange(len(lines))
            if rng.random() < 0.5:
                lines.insert(which, picked)
            else:
                del lines[which]
            return bytearray(b"\n".join(lines))
        tokens = _TOKEN.findall(bytes(data))
        if not tokens:
            return data
        which = rng.randrange(len(tokens))
        tokens[which] = rng.choice(self.shape.tokens) if rng.random() < 0.85 else b""
        return bytearray(b"".join(tokens))
