"""Decoders of what comes from processes of our own: plans, records, requests, mapped files.

Each target takes bytes, says whether they were taken, and raises when an invariant is broken.
"""

import atexit
import json
import os
import socket
import struct
import tempfile
from pathlib import Path

from demand import must, words
from machines import compact

from motionserver.core.plan import pack, unpack
from motionserver.guard.loop import as_request
from motionserver.settings.tuning_book import TuningBook
from motionserver.telemetry.link import GuardClock, unpack_cue
from motionserver.telemetry.mapped import MappedFile, crc_of
from motionserver.telemetry.requests import RequestServer

PLAN_HEAD = struct.Struct("<QQdII")


def plan(data):
    """Header of 32 bytes, then knots of 19 doubles; 1 to 1024 of them, and nothing else."""
    count = struct.unpack_from("<I", data, 24)[0] if len(data) >= 32 else 0
    right = 1 <= count <= 1024 and len(data) == 32 + 152 * count
    try:
        found = unpack(data)
    except ValueError as error:
        must(not right, f"refused without need: {error}")
        words(error, "plan", str(len(data)))
        return False
    assert right, "taken in spite of its form"
    assert found.times.shape == (count,)
    assert found.pose.shape == found.velocity.shape == found.acceleration.shape == (count, 6)
    for table in (found.times, found.pose, found.velocity, found.acceleration):
        assert not table.flags.writeable
    again = pack(found)
    assert again[:28] == data[:28]
    assert again[32:] == data[32:], "written again it differs"
    return True


def link(data):
    """The two small records between planner and guard."""
    try:
        status = unpack_cue(data)
    except (ValueError, struct.error) as error:
        must(not 33 <= len(data) <= 333 or data[16] > 3, "told too little")
        must(str(error), "told too little")
        status = None
    if status is not None:
        assert 33 <= len(data) <= 333
        assert int(status.mode) == data[16] <= 3
        assert (status.newest_ns, status.stale_after_ns) == struct.unpack_from("<QQ", data)
        assert (status.looked_ns, status.heard_ns) == struct.unpack_from("<QQ", data, 17)
        assert status.trouble.isprintable() or not status.trouble
        for now in (1, status.newest_ns + 300_000_001):
            assert status.is_stale(now) or now - status.newest_ns <= 300_000_000
    try:
        clock = GuardClock.unpack(data)
    except struct.error:
        must(len(data) != 67, "told too little")
        clock = None
    if clock is not None:
        assert len(data) == 67
        assert clock.pack() == data, "written again it differs"
    return status is not None or clock is not None


class _Desk:
    """A real request socket and a tuning book behind it."""

    def __init__(self):
        folder = Path(tempfile.mkdtemp(prefix="fuzz"))
        self.server = RequestServer(folder / "guard.sock")
        self.sender = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.sender.connect(str(folder / "guard.sock"))
        self.machine = compact()
        (folder / "guard.sock").unlink()
        folder.rmdir()
        atexit.register(self.sender.close)
        atexit.register(self.server.close)


_DESKS = []


def request(data):
    """A datagram of at most 4096 bytes: a JSON object with a word under "op"."""
    if not _DESKS:
        _DESKS.append(_Desk())
    desk = _DESKS[0]
    malformed = desk.server.malformed
    desk.sender.send(data)
    polled = desk.server.poll()
    assert len(polled) + desk.server.malformed - malformed == 1
    right = len(data) <= 4096 and _is_request(data)
    assert bool(polled) == right, "taken" if polled else "refused without need"
    if not polled:
        return False
    message = polled[0][0]
    edge = as_request(message, None)
    assert edge.op in ("engage", "park", "reset", "unknown")
    assert len(edge.by) <= 20
    clock = iter(range(1_000_000))
    answer = TuningBook(desk.machine, lambda: float(next(clock))).answer(message)
    assert type(answer["ok"]) is bool
    assert len(json.dumps(answer, allow_nan=False)) < 16384, "an answer longer than a datagram"
    return True


def _is_request(data):
    try:
        message = json.loads(data)
    except (ValueError, RecursionError):
        return False
    return isinstance(message, dict) and isinstance(message.get("op"), str)


_FILES = []


def mapped(data):
    """A file of two slots: whoever opens it gets the newest whole message, or a ValueError."""
    if not _FILES:
        descriptor, name = tempfile.mkstemp(prefix="fuzz")
        _FILES.append((descriptor, Path(name)))
        atexit.register(Path(name).unlink)
    descriptor, path = _FILES[0]
    os.ftruncate(descriptor, 0)
    os.pwrite(descriptor, data, 0)
    capacity = struct.unpack_from("<I", data, 4)[0] if len(data) >= 8 else 0
    right = data[:4] == b"FMSM" and len(data) == 8 + 2 * (16 + capacity)
    slots = [_slot(data, at, capacity) for at in (8, 24 + capacity)] if right else []
    wanted = max(filter(None, slots), default=None)
    if right:
        told = [struct.unpack_from("<Q", data, at)[0] for at in (8, 24 + capacity)]
        right = (max(told) if wanted is None else wanted[0]) < 1 << 63
    try:
        found = MappedFile(path)
    except ValueError as error:
        must(not right, f"refused without need: {error}")
        words(error, str(path))
        return False
    assert right, "taken in spite of its form"
    try:
        read = found.read()
        assert read == wanted or (read and wanted and read[0] == wanted[0])
        found.write(data[:capacity])
        assert found.read()[1] == data[:capacity], "what was written is not read"
    finally:
        found.close()
    return wanted is not None


def _slot(data, at, capacity):
    sequence, length, crc = struct.unpack_from("<QII", data, at)
    body = data[at + 16 : at + 16 + length]
    right = sequence and length <= capacity and crc_of(sequence, body) == crc
    return (sequence, body) if right else None
