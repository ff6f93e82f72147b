"""Decoders of foreign packets: BeamNG, the platform's replies, the emulated base's commands.

Each target takes bytes, says whether they were taken, and raises when an invariant is broken.
"""

import math
import pickle
import struct

from demand import NOW, close, gravity_of, is_number, must, same, words
from motion_clients.moog_device import MoogDevice
from motion_clients.moog_wire import decode_command

from motionserver.platforms.base import PlatformOptions, PlatformPacketError
from motionserver.platforms.moog import Moog6Dof2000E
from motionserver.sources.base import SourceError
from motionserver.sources.beamng import BeamNgSource


def beamng(data):
    source = BeamNgSource()
    known = data[:4] in (b"BNG1", b"BNG2")
    long = len(data) == 88 or (len(data) > 88 and data[:4] == b"BNG2")
    values = struct.unpack_from("<21f", data, 4) if len(data) >= 88 else ()
    right = known and long and all(map(math.isfinite, values))
    try:
        motion = source.decode(data, NOW)
    except SourceError as error:
        must(not right, f"refused without need: {error}")
        other = not known and len(data) in (92, 96)
        wanted = (
            "outgauge" if other else "magic" if not known else "size" if not long else "not_finite"
        )
        same(error.reason, wanted, "reason")
        words(error, "beamng")
        return False
    assert right, "taken in spite of its form"
    is_number(motion.force, motion.rates, motion.speed)
    acc_x, acc_y, acc_z = values[6:9]
    close(motion.force, (acc_y, -acc_x, acc_z), gravity_of(values[12], -values[13]))
    same(tuple(motion.rates), (values[15], -values[16], -values[17]), "rates")
    same(int(motion.mode), 0, "mode of a first packet")
    same(int(source.decode(data, NOW + 10_000_000).mode), 0, "mode of the same place again")
    return True


_MOOGS = tuple(
    Moog6Dof2000E(PlatformOptions(mode, 0.9022, (2, 0, 1, 5, 4, 3))) for mode in ("length", "dof")
)
_STATES = {0, 1, 2, 3, 7, 8, 9, 10, 11, 12}


def moog_reply(data):
    values = struct.unpack_from(">6f", data, 12) if len(data) == 40 else ()
    state = data[11] & 15 if len(data) == 40 else None
    right = len(data) == 40 and all(map(math.isfinite, values)) and state in _STATES
    taken = []
    for moog in _MOOGS:
        try:
            feedback = moog.decode(data, NOW)
        except PlatformPacketError as error:
            must(not right, f"refused without need: {error}")
            fine = all(map(math.isfinite, values))
            wanted = "size" if len(data) != 40 else "state" if fine else "not_finite"
            same(error.reason, f"feedback_{wanted}", "reason")
            words(error, "moog")
            taken.append(False)
            continue
        assert right, "taken in spite of its form"
        taken.append(True)
        assert (feedback.legs is None) != (feedback.pose is None)
        assert (feedback.pose is not None) == bool(data[11] & 0x80)
        is_number(feedback.legs if feedback.pose is None else feedback.pose)
        same(feedback.estop, bool(data[7] & 0x80), "emergency stop")
        same(len(feedback.faults), bin(data[2] << 8 | data[3]).count("1"), "faults")
        if feedback.legs is not None:
            placed = [feedback.legs[leg] - 0.9022 for leg in (2, 0, 1, 5, 4, 3)]
            for one, value in zip(placed, values, strict=True):
                assert abs(one - value) <= 1e-12 + 1e-12 * abs(value)
        else:
            roll, pitch, heave, surge, yaw, lateral = values
            wanted = (surge, -lateral, -0.2286 - heave, roll, -pitch, -yaw)
            same(tuple(feedback.pose), wanted, "pose")
    return taken[0]


def _base(*words_first):
    """A base that was told some words for nine seconds each, as bytes to be woken from."""
    base, now = MoogDevice(), 0.0
    for word in words_first:
        for _ in range(90):
            now += 0.1
            base.receive(struct.pack(">I6fI", word, *base.legs.extensions, 0), now)
    return pickle.dumps(base)


_BASES = []


def command(data):
    """The emulated base, in each of its states: one finite answer to what has the right length."""
    try:
        told = decode_command(data)
    except ValueError as error:
        must(len(data) != 32, "told too little")
        words(error, str(len(data)), "32")
        return False
    same(len(data), 32, "length")
    same(told.mcw, data[3], "word")
    for one, value in zip(told.words, struct.unpack(">6f", data[4:28]), strict=True):
        assert one == value or one != one != value != value
    if not _BASES:
        # switched on, down, raised and following, raised by pose, parking
        ways = ((), (172,), (172, 180, 130), (170, 180), (172, 180, 130, 220))
        _BASES.extend([_base(*way), None] for way in ways)
    slot = _BASES[data[31] % len(_BASES)]
    if slot[1] is None:
        slot[1] = pickle.loads(slot[0])
    base = slot[1]
    before = (base.state, base.mode, base.faults, base.target)
    reply = base.receive(data, base.now)
    known = told.mcw in (128, 130, 140, 150, 155, 160, 170, 172, 175, 180, 190, 200, 210, 220)
    right = known and all(map(math.isfinite, told.words))
    assert bool(base.faults & 0x100) != right, "an invalid frame and its fault go together"
    _answer(reply)
    if (base.state, base.mode, base.faults, base.target) != before:
        slot[1] = None
        base.advance(base.now + 0.05)
        _answer(base.receive(struct.pack(">I6fI", 172, *[0.0] * 6, 0), base.now))
        assert all(map(math.isfinite, base.legs.extensions)), "the legs lost themselves"
    return right


def _answer(reply):
    same(len(reply), 40, "reply")
    assert all(map(math.isfinite, struct.unpack(">6f", reply[12:36]))), "no number is answered"
