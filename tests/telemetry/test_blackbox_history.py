"""A history keeps the newest messages whole, whoever dies in between, its room taken at once."""

import errno
import os
import resource

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motionserver.telemetry.blackbox.history import History, open_history
from motionserver.telemetry.blackbox.records import GUARD, PACKET
from motionserver.telemetry.blackbox.room import FOLDER, clear_room, make_room


@pytest.fixture
def path(tmp_path):
    return tmp_path / "x.history"


@given(
    slots=st.integers(1, 6),
    lives=st.lists(st.lists(st.binary(max_size=8), max_size=9), min_size=1, max_size=4),
    since=st.integers(0, 12),
)
@settings(max_examples=100, deadline=None)
def test_the_newest_messages_are_kept_over_restarts(tmp_path_factory, slots, lives, since):
    path = tmp_path_factory.mktemp("h") / "x.history"
    reader = History.create(path, 8, slots)
    for messages in lives:
        writer = History(path)
        for data in messages:
            writer.write(data)
        writer.close()
    everything = list(enumerate((data for life in lives for data in life), start=1))
    assert reader.newest_sequence() == len(everything)
    assert reader.since(since) == [one for one in everything[-slots:] if one[0] > since]


@given(st.integers(0, 200), st.integers(1, 255))
@settings(max_examples=60, deadline=None)
def test_a_damaged_byte_costs_at_most_its_message(tmp_path_factory, at, flip):
    path = tmp_path_factory.mktemp("h") / "x.history"
    writer = History.create(path, 20, 4)
    written = [(number, bytes([number]) * 20) for number in range(1, 8)]
    for _, data in written:
        writer.write(data)
    raw = bytearray(path.read_bytes())
    begin = 24
    raw[begin + at % (len(raw) - begin)] ^= flip
    path.write_bytes(raw)
    found = History(path).since()
    assert len(found) >= 3
    assert set(found) <= set(written[-4:])


def test_a_writer_killed_before_the_head_was_told_loses_nothing(path):
    writer = History.create(path, 8, 4)
    for data in (b"one", b"two"):
        writer.write(data)
    raw = bytearray(path.read_bytes())
    raw[16:24] = (1).to_bytes(8, "little")
    path.write_bytes(raw)
    again = History(path)
    assert [data for _, data in again.since()] == [b"one", b"two"]
    again.write(b"three")
    assert [data for _, data in again.since()] == [b"one", b"two", b"three"]


def test_a_message_that_is_too_long_is_counted(path):
    history = History.create(path, 4, 2)
    history.write(b"12345")
    history.write(b"1234")
    assert history.too_long == 1
    assert history.since() == [(1, b"1234")]


def test_what_is_no_history_is_none(path):
    assert open_history(path) is None
    for size in (0, 10, 100):
        path.write_bytes(bytes(size))
        assert open_history(path) is None


def test_all_room_is_taken_at_once_and_a_full_disk_leaves_nothing(tmp_path):
    make_room(tmp_path, 60.0, 60.0)
    folder = tmp_path / FOLDER
    files = list(folder.iterdir())
    assert len(files) == 7
    assert folder.stat().st_mode & 0o777 == 0o700
    for file in files:
        stat = file.stat()
        assert stat.st_blocks * 512 >= stat.st_size
        assert stat.st_mode & 0o777 == 0o600
    where = folder.resolve()
    clear_room(tmp_path)
    assert not where.exists()
    assert not folder.is_symlink()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 20, limits[1]))
    try:
        with pytest.raises(OSError, match=os.strerror(errno.EFBIG)):
            make_room(tmp_path, 60.0, 60.0)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert list(tmp_path.iterdir()) == []


def test_records_are_small_enough_for_their_minute():
    assert len(set(GUARD.names)) == len(GUARD.names)
    assert GUARD.size * 7200 + PACKET.size * 15000 < 8e6
