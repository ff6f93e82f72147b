import os
import resource
import signal
import struct
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motionserver.telemetry.mapped import MappedFile, crc_of

SLOT = struct.Struct("<QII")


@pytest.fixture
def path(tmp_path):
    return tmp_path / "plan.map"


def test_before_the_first_message_there_is_none(path):
    assert MappedFile(path, 64).read() is None
    assert path.stat().st_mode & 0o777 == 0o600
    assert path.stat().st_size == 8 + 2 * (16 + 64)


def test_the_newest_message_wins(path):
    writer, reader = MappedFile(path, 64), MappedFile(path)
    for number in range(1, 8):
        data = bytes([number]) * number
        writer.write(data)
        assert reader.newest_sequence() == number
        assert reader.read() == (number, data)
    writer.write(b"")
    assert reader.read() == (8, b"")
    writer.write(bytes(64))
    assert reader.read() == (9, bytes(64))
    with pytest.raises(ValueError, match="65 bytes, a slot holds 64"):
        writer.write(bytes(65))
    writer.close()
    assert reader.read() == (9, bytes(64))


def test_a_writer_that_starts_again_goes_on_counting(path):
    MappedFile(path, 64).write(b"one")
    again = MappedFile(path, 64)
    again.write(b"two")
    assert MappedFile(path).read() == (2, b"two")


@given(st.integers(1, 5), st.integers(0, 15), st.integers(1, 255))
def test_a_damaged_slot_gives_the_message_before(tmp_path_factory, count, byte, flip):
    path = tmp_path_factory.mktemp("map") / "x.map"
    writer = MappedFile(path, 32)
    for number in range(1, count + 1):
        writer.write(bytes([number]) * 20)
    slot = 8 + (count & 1) * (16 + 32)
    raw = bytearray(path.read_bytes())
    raw[slot + byte] ^= flip
    path.write_bytes(raw)
    found = MappedFile(path).read()
    assert found == ((count - 1, bytes([count - 1]) * 20) if count > 1 else None)


def test_a_half_written_body_is_not_read(path):
    writer = MappedFile(path, 32)
    writer.write(b"a" * 20)
    writer.write(b"b" * 20)
    raw = bytearray(path.read_bytes())
    body = 8 + (16 + 32) + 16
    raw[body : body + 7] = b"c" * 7
    path.write_bytes(raw)
    assert MappedFile(path).read() == (2, b"b" * 20)


def test_after_a_torn_header_the_whole_message_stays(path):
    """Killed between sequence and checksum: the next writer must spare the only whole slot."""
    writer = MappedFile(path, 32)
    for data in (b"one", b"two"):
        writer.write(data)
    raw = bytearray(path.read_bytes())
    raw[8 + 48 : 8 + 48 + 8] = struct.pack("<Q", 3)
    path.write_bytes(raw)
    again = MappedFile(path, 32)
    assert again.read() == (2, b"two")
    again.write(b"three")
    raw = path.read_bytes()
    assert SLOT.unpack_from(raw, 8)[0] == 2
    assert again.read() == (3, b"three")


def test_all_room_is_taken_at_once_and_a_full_disk_refuses_the_start(path):
    MappedFile(path, 1 << 20)
    assert path.stat().st_blocks * 512 >= 2 << 20
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 20, limits[1]))
    try:
        with pytest.raises(OSError, match="too large"):
            MappedFile(path.with_name("other.map"), 1 << 20)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize("size", [0, 7, 8, 100])
def test_other_files_are_refused(path, size):
    path.write_bytes(bytes(size))
    with pytest.raises(ValueError, match="not a mapped file"):
        MappedFile(path)


def test_another_capacity_is_refused(path):
    MappedFile(path, 64)
    with pytest.raises(ValueError, match="64 bytes per slot, 65 wanted"):
        MappedFile(path, 65)
    with pytest.raises(FileNotFoundError):
        MappedFile(path.with_name("none"))


CHILD = """
import sys
from pathlib import Path
from motionserver.telemetry.mapped import MappedFile, crc_of
file = MappedFile(Path(sys.argv[1]))
print("up", flush=True)
number = 0
while True:
    if sys.argv[2] == "write":
        number += 1
        file.write(number.to_bytes(4, "little") * 500)
    else:
        file.read()
"""


def child(path, role):
    """A process of its own that reads or writes without a pause."""
    process = subprocess.Popen(
        [sys.executable, "-c", CHILD, str(path), role],
        stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    assert process.stdout.readline() == b"up\n"
    return process


def kill(process):
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdout.close()


def whole(data):
    return len(data) == 2000 and data == data[:4] * 500


def test_readers_and_writers_may_be_killed_at_any_instant(path):
    reader = MappedFile(path, 2000)
    newest = 0
    for _ in range(4):
        writer, other = child(path, "write"), child(path, "read")
        seen = 0
        for _ in range(3000):
            found = reader.read()
            if found is None:
                # overtaken in both slots, several times in a row: rare, and told as nothing new
                continue
            assert whole(found[1])
            assert found[0] >= newest
            newest, seen = found[0], seen + 1
        assert seen > 1000
        kill(other)
        kill(writer)
        found = reader.read()
        assert found is not None
        assert whole(found[1])
        newest = 0 if found[0] < newest else newest
    own = MappedFile(path)
    own.write(b"still here")
    assert reader.read() == (own.newest_sequence(), b"still here")


@pytest.mark.parametrize("crc", ["right", "torn"])
def test_a_sequence_that_leaves_no_room_is_refused(path, crc):
    last = (1 << 64) - 1
    MappedFile(path, 8).write(b"x")
    data = bytearray(path.read_bytes())
    checked = crc_of(last, b"x") if crc == "right" else 0
    data[8:32] = SLOT.pack(last, 1, checked) + b"x".ljust(8, b"\0")
    data[32:] = bytes(24)
    path.write_bytes(data)
    with pytest.raises(ValueError, match="was never written; remove it"):
        MappedFile(path)
