"""Faults in what the simulator's packets say, or in who sends them: F2 to F5, F8, F9, F35."""

import math
import struct
import zlib
from dataclasses import replace
from typing import ClassVar

import stated
from motion_protocol import Flags, Mode, encode_cue
from motion_protocol.cue import CUE_LAYOUT
from scenario import TICK, stale
from scenes_client import ClientFault

from motionserver.core.axes import GRAVITY

HEAD, SUM, VALUES = 40, 44, 48
"""Where a cue's checksum is, its payload begins, and the first acceleration stands."""
KEY = bytes(range(32))


def forged(packet, offset, data):
    """The packet with other bytes at ``offset``, and a checksum that is right again."""
    out = bytearray(packet)
    out[offset : offset + len(data)] = data
    head = zlib.crc32(out[:HEAD], zlib.crc32(CUE_LAYOUT))
    struct.pack_into("<I", out, HEAD, zlib.crc32(out[SUM:], head))
    return bytes(out)


class F2(ClientFault):
    number = 2
    title = "NaN, inf, denormal numbers"
    detection = "isfinite of every field; share of bad packets over 1 s"
    reaction = stated.BAD_SHARE
    recovery = "automatic"
    counter = "refused_not_finite"

    def __init__(self, world, rng):
        super().__init__(world, rng)
        self.share = rng.choice((0.02, 0.5, 0.9))
        self.seconds = rng.uniform(1.3, 2.2)
        self.wrong = [struct.pack("<f", v) for v in (math.nan, math.inf, -math.inf)]
        self.returns = self.stays = self.share < 0.1

    def strike(self):
        self.client.spoil.append(self._spoil)
        self.client.alter.append(self._tiny)

    def _tiny(self, cue):
        """Denormal numbers are numbers: next to nothing is felt."""
        return replace(cue, motion=replace(cue.motion, rates=(1e-42, -1e-42, 1e-45)))

    def _spoil(self, data):
        if self.is_wrong(self.share):
            return [forged(data, VALUES + 4 * self.rng.randrange(6), self.rng.choice(self.wrong))]
        return [data]

    def relent(self):
        self.client.spoil.remove(self._spoil)
        self.client.alter.remove(self._tiny)

    def reacted(self):
        return super().reacted() if self.share < 0.1 else self.has_left_run

    def bound(self):
        return (
            super().bound()
            if self.stays
            else 1.0 + stale(self.world) + self.world.period + 2 * TICK
        )


class F3(ClientFault):
    number = 3
    title = "spike or teleport of the vehicle"
    detection = "range gate, slew and jump gates at the input"
    reaction = "clipped, blanked or dropped, and counted; the drive goes on"
    recovery = "automatic"
    counter = "refused_out_of_range"
    stays = True

    def __init__(self, world, rng):
        super().__init__(world, rng)
        self.kind = rng.choice(("spike", "beyond", "teleport"))
        self.seconds = rng.uniform(1.0, 3.0)
        self.size = rng.choice((-1, 1)) * rng.uniform(40.0, 90.0)

    def strike(self):
        self._seen = (self._intake.clipped, self._intake.teleports)
        self.client.alter.append(self._alter)

    @property
    def _intake(self):
        return self.world.planner._intake

    def _alter(self, cue):
        motion = cue.motion
        if self.kind == "teleport":
            return replace(cue, motion=replace(motion, speed=motion.speed + self.size))
        # only the newest packet of a period is felt: a spike lasts a few; what is dropped for as
        # long would be silence
        if self.is_wrong(0.0 if self.kind == "beyond" else 0.01):
            self._until_ns = self.world.now + (20_000_000 if self.kind == "beyond" else 40_000_000)
        if self.world.now > self._until_ns:
            return cue
        size = self.size * (4.0 if self.kind == "beyond" else 1.0)
        return replace(
            cue, motion=replace(motion, acceleration=(size, -size, motion.acceleration[2]))
        )

    def relent(self):
        self.client.alter.remove(self._alter)

    def reacted(self):
        if self.kind == "beyond":
            return super().reacted()
        return (self._intake.clipped, self._intake.teleports) != self._seen


class F4(ClientFault):
    number = 4
    title = "wrong size, magic, version, byte order"
    detection = "length, magic, version, checksum, range"
    reaction = "dropped and counted; the drive goes on with what is left, without any as F1"
    recovery = "automatic"
    counter = "refused"
    returns = True

    def __init__(self, world, rng):
        super().__init__(world, rng)
        self.kind = rng.choice(("stranger", "few", "many"))
        self.seconds = rng.uniform(1.3, 2.2)
        self.share = {"stranger": 0.9, "few": 0.04, "many": 0.3}[self.kind]
        self.stays = self.kind != "many"

    def strike(self):
        self.client.spoil.append(self._spoil)

    def _spoil(self, data):
        rng = self.rng
        if not self.is_wrong(self.share):
            return [data]
        swapped = b"".join(data[i : i + 4][::-1] for i in range(VALUES, VALUES + 24, 4))
        wrong = rng.choice(
            (
                data[: rng.randrange(len(data))],
                data + bytes(rng.randrange(1, 400)),
                data[:4][::-1] + data[4:],
                data[:4] + bytes([9]) + data[5:],
                data[:50] + bytes([data[50] ^ 1]) + data[51:],
                rng.randbytes(rng.randrange(0, 200)),
                forged(data, VALUES, swapped),
            )
        )
        if self.kind == "stranger":
            self.world.way.put(wrong, "198.51.100.4:7")
            return [data]
        return [wrong]

    def relent(self):
        self.client.spoil.remove(self._spoil)


class F5(ClientFault):
    number = 5
    title = "packets reordered, doubled, replayed"
    detection = "sequence and session"
    reaction = "only what is newer is kept, the rest counted"
    recovery = "automatic"
    counter = "refused_re"
    stays = True

    def strike(self):
        self.former = list(self.client.sent)
        self.client.link.flaws = replace(
            self.client.link.flaws, duplicate=0.3, reorder=0.3, reorder_delay=0.025
        )
        self.client.spoil.append(self._replay)

    def _replay(self, data):
        return [data, self.rng.choice(self.former)] if self.is_wrong(0.3) else [data]

    def relent(self):
        self.client.spoil.remove(self._replay)
        self.client.link.flaws = replace(self.client.link.flaws, duplicate=0.0, reorder=0.0)


class F8(ClientFault):
    number = 8
    title = "rogue client without the key"
    detection = "signature of every packet"
    reaction = "dropped and counted; the drive goes on"
    recovery = "none needed"
    setup: ClassVar[dict] = {"key": KEY}
    counter = "refused_hmac"
    stays = True

    def strike(self):
        self._goes_on = True
        self._rogue()

    def _rogue(self):
        """As if it were the client itself: its session, its next number."""
        cue = replace(self.client.cue(), session=self.client.session)
        wrong = self.rng.choice((None, bytes(32), b"guess" * 7))
        address = self.rng.choice((self.client.address, "198.51.100.4:7"))
        self.world.way.put(encode_cue(cue, wrong), address)
        if self._goes_on:
            self.world.after(0.002, self._rogue)

    def relent(self):
        self._goes_on = False


class F9(ClientFault):
    number = 9
    title = "flood of 100,000 packets a second"
    detection = stated.FLOOD
    reaction = "the guard does not notice; the own client may starve: as F1"
    recovery = "automatic"
    counter = "refused"

    def __init__(self, world, rng):
        super().__init__(world, rng)
        self.seconds = rng.uniform(0.3, 1.3)
        self.returns = True

    def strike(self):
        self._late = self.world.counters["late_ticks"]
        self.world.way.flood_hz = 100_000.0

    def relent(self):
        self.world.way.flood_hz = 0.0

    def check(self):
        late = self.world.counters["late_ticks"] - self._late
        return [f"F9: {late} late ticks of the guard"] if late else []


class F35(ClientFault):
    number = 35
    title = "wrong units, signs or gravity: degrees for radians, g for m/s2"
    detection = (
        "standstill feels 9.81 m/s2, medians of 10 s, attitude within pi and pi/2, rates against "
        "attitude, speed against acceleration"
    )
    reaction = "told to operator and client; engaging is refused"
    recovery = "a client with other units"
    from_start = True

    def __init__(self, world, rng):
        super().__init__(world, rng)
        self.seconds = 6.5
        self.kind = rng.choice(("degrees", "g"))

    def strike(self):
        self.client.alter.append(self._alter)
        # five seconds are needed to tell, the guard a while to be parked
        self.world.after(6.0, self._ask)

    def _ask(self):
        self._asked_ns = self.world.now
        self._count = len(self.world.account.refusals)
        self.world.ask("engage")

    def _alter(self, cue):
        motion = cue.motion
        if self.kind == "degrees":
            wrong = tuple(math.degrees(3.0 * rate) for rate in motion.rates)
            return replace(cue, motion=replace(motion, rates=wrong))
        ax, ay, az = motion.acceleration
        in_g = (ax / GRAVITY, ay / GRAVITY, az / GRAVITY + 1.0)
        motion = replace(motion, acceleration=in_g)
        return replace(cue, motion=motion, flags=Flags.GRAVITY_INCLUDED)

    def relent(self):
        """The client goes and comes back mended."""
        self.client.alter.clear()
        self.client.mode = Mode.BYE
        self.client.send()
        self.client.mode, self.client.session, self.client.sequence = Mode.DRIVE, 9, 0

    def onset_ns(self):
        return self._asked_ns

    def reacted(self):
        # a refusal lasts: what is looked at is the answer to the edge
        return self.world.now > getattr(self, "_asked_ns", 1 << 62) and (
            len(self.world.account.refusals) > self._count
        )

    def bound(self):
        return 2 * TICK


SCENES = (F2, F3, F4, F5, F8, F9, F35)
