"""Mapped files between processes: two slots, sequence and CRC, the newest valid one wins.

Not `multiprocessing.shared_memory`: on Python 3.11 a reader that exits unlinks the segment for
everybody. A file in the run directory outlives all of its readers and writers.
"""

from __future__ import annotations

import mmap
import os
import stat
import struct
from pathlib import Path
from typing import Final
from zlib import crc32

from motionserver.telemetry.run_files import open_run_file

_MAGIC: Final = 0x4D53_4D46
_HEAD: Final = struct.Struct("<II")
SLOT: Final = struct.Struct("<QII")
"""Before every message: its sequence, its length, `crc_of` both."""
_ATTEMPTS: Final = 4
_ENDLESS: Final = 1 << 63
"""No writer lives until this sequence, and there must be room to go on."""


def crc_of(sequence: int, data: bytes) -> int:
    """Over the sequence as well, so that a torn header is seen."""
    return crc32(data, crc32(sequence.to_bytes(8, "little")))


def mapping_of(path: Path, least: int) -> mmap.mmap:
    """Map a whole file, to read and to write.

    Raises:
        OSError: It cannot be opened.
        ValueError: It has fewer than ``least`` bytes.
    """
    descriptor = open_run_file(path, os.O_RDWR)
    try:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise ValueError(f"{path}: not a mapped file")
        size = os.fstat(descriptor).st_size
        if size < least:
            raise ValueError(f"{path}: not a mapped file ({size} bytes)")
        return mmap.mmap(descriptor, size)
    finally:
        os.close(descriptor)


class MappedFile:
    """One writer, any readers; create it once, before the processes start."""

    def __init__(self, path: Path, capacity: int | None = None) -> None:
        """Open, or create with ``capacity`` bytes per slot.

        Raises:
            OSError: The file cannot be opened.
            ValueError: It is not a mapped file of ours, or has another capacity.
        """
        self.path = path
        if capacity is not None and not path.exists():
            self._create(path, capacity)
        self._map = mapping_of(path, _HEAD.size)
        size = len(self._map)
        magic, capacity_found = _HEAD.unpack_from(self._map)
        self.capacity = int(capacity_found)
        expected = _HEAD.size + 2 * (SLOT.size + self.capacity)
        if magic != _MAGIC or size != expected:
            raise ValueError(
                f"{path}: not a mapped file of this version; remove it and start again"
            )
        if capacity is not None and capacity != self.capacity:
            raise ValueError(f"{path}: {self.capacity} bytes per slot, {capacity} wanted")
        # go on after the newest whole message: a torn header must not turn us onto its slot
        newest = self.read()
        self._sequence = self.newest_sequence() if newest is None else newest[0]
        if self._sequence >= _ENDLESS:
            raise ValueError(
                f"{path}: sequence {self._sequence} was never written; remove it and start again"
            )

    @staticmethod
    def _create(path: Path, capacity: int) -> None:
        temporary = path.with_suffix(f".{os.getpid()}")
        try:
            with temporary.open("wb") as file:
                # all room now: a page that a full disk refuses later kills whoever writes to it
                os.posix_fallocate(file.fileno(), 0, _HEAD.size + 2 * (SLOT.size + capacity))
                file.write(_HEAD.pack(_MAGIC, capacity))
        except OSError:
            temporary.unlink()
            raise
        temporary.chmod(0o600)
        temporary.rename(path)

    def _offset(self, slot: int) -> int:
        return _HEAD.size + slot * (SLOT.size + self.capacity)

    def _header(self, slot: int) -> tuple[int, int, int]:
        sequence, length, crc = SLOT.unpack_from(self._map, self._offset(slot))
        return sequence, length, crc

    def write(self, data: bytes) -> None:
        """Publish ``data``; readers see the previous one until it is complete.

        Raises:
            ValueError: More bytes than a slot holds.
        """
        if len(data) > self.capacity:
            raise ValueError(f"{self.path}: {len(data)} bytes, a slot holds {self.capacity}")
        self._sequence += 1
        offset = self._offset(self._sequence & 1)
        body = offset + SLOT.size
        self._map[body : body + len(data)] = data
        crc = crc_of(self._sequence, data)
        SLOT.pack_into(self._map, offset, self._sequence, len(data), crc)

    def newest_sequence(self) -> int:
        """Sequence of the newest slot, valid or not: cheap, to see that something is new."""
        return max(self._header(0)[0], self._header(1)[0])

    def read(self) -> tuple[int, bytes] | None:
        """The newest complete message with its sequence; None before the first."""
        # a writer may overtake a slow reader in both slots: then look again
        for _ in range(_ATTEMPTS):
            for slot in sorted((0, 1), key=lambda s: self._header(s)[0], reverse=True):
                sequence, length, crc = self._header(slot)
                if sequence == 0 or length > self.capacity:
                    continue
                body = self._offset(slot) + SLOT.size
                data = self._map[body : body + length]
                if crc_of(sequence, data) == crc:
                    return sequence, data
        return None

    def close(self) -> None:
        """Unmap; the file stays."""
        self._map.close()
