"""A mapped file that keeps the newest messages of one writer, not only the last.

As `telemetry.mapped`, with more slots: one writer, any readers, nothing is locked, and what was
written outlives the writer, however it died. A message that is overtaken while it is read is left
out. All room is taken when the file is made: a disk that fills up later can neither cost a message
nor, as with a file of holes, the life of the writer.
"""

from __future__ import annotations

import os
import struct
from pathlib import Path
from typing import Final

from motionserver.telemetry.mapped import SLOT, crc_of, mapping_of

_MAGIC: Final = 0x4D53_4848
_HEAD: Final = struct.Struct("<IIIIQ")
_NEWEST: Final = struct.Struct("<Q")
_NEWEST_AT: Final = 16


class History:
    """The newest messages of one writer.

    Attributes:
        capacity: Bytes a message may have.
        slots: How many are kept.
        too_long: Messages that were left out because they were longer.
    """

    def __init__(self, path: Path) -> None:
        """Open.

        Raises:
            OSError: It cannot be opened.
            ValueError: It is no history of this version.
        """
        self._map = mapping_of(path, _HEAD.size)
        size = len(self._map)
        magic, capacity, slots, _, _ = _HEAD.unpack_from(self._map)
        self.capacity, self.slots = int(capacity), int(slots)
        if magic != _MAGIC or size != _size(self.capacity, self.slots):
            raise ValueError(f"{path}: not a history of this version")
        self._stride = SLOT.size + self.capacity
        # whoever wrote before may have died between a message and the head
        self._sequence = max(self._message(slot)[0] for slot in range(self.slots))
        self.too_long = 0

    @staticmethod
    def create(path: Path, capacity: int, slots: int) -> History:
        """Make an empty one, all its room taken.

        Raises:
            OSError: There is no room, or the folder cannot be written.
        """
        with path.open("wb") as file:
            path.chmod(0o600)
            os.posix_fallocate(file.fileno(), 0, _size(capacity, slots))
            file.write(_HEAD.pack(_MAGIC, capacity, slots, 0, 0))
        return History(path)

    def _at(self, slot: int) -> int:
        return _HEAD.size + slot * self._stride

    def write(self, data: bytes) -> None:
        """Add a message; one that is too long is counted and left out."""
        if len(data) > self.capacity:
            self.too_long += 1
            return
        self._sequence += 1
        sequence = self._sequence
        offset = self._at(sequence % self.slots)
        body = offset + SLOT.size
        self._map[body : body + len(data)] = data
        SLOT.pack_into(self._map, offset, sequence, len(data), crc_of(sequence, data))
        _NEWEST.pack_into(self._map, _NEWEST_AT, sequence)

    def newest_sequence(self) -> int:
        """Number of the newest message; 0 before the first."""
        return int(_NEWEST.unpack_from(self._map, _NEWEST_AT)[0])

    def since(self, sequence: int = 0) -> list[tuple[int, bytes]]:
        """Whole messages after number ``sequence`` that are still kept, oldest first."""
        newest = self.newest_sequence()
        out = []
        # one more than the head tells: its writer may have died just before it said so
        for number in range(max(sequence, newest - self.slots, 0) + 1, newest + 2):
            found, data = self._message(number % self.slots)
            if found == number:
                out.append((number, data))
        return out

    def _message(self, slot: int) -> tuple[int, bytes]:
        """Number and text of what a slot holds; 0 if it is not whole."""
        offset = self._at(slot)
        number, length, crc = SLOT.unpack_from(self._map, offset)
        body = offset + SLOT.size
        data = self._map[body : body + min(length, self.capacity)]
        return (number, data) if crc_of(number, data) == crc else (0, b"")

    def close(self) -> None:
        """Unmap; the file stays."""
        self._map.close()


def open_history(path: Path) -> History | None:
    """A history, or None where there is none: then nothing is kept, and nothing else suffers."""
    try:
        return History(path)
    except (OSError, ValueError):
        return None


def _size(capacity: int, slots: int) -> int:
    return _HEAD.size + slots * (SLOT.size + capacity)
