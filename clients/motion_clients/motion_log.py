"""Record of every datagram a device received: one line of instant and bytes each."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from io import TextIOWrapper
from pathlib import Path
from types import TracebackType
from typing import Self

from .datagram import own_bytes

_KEPT = 100_000


class MotionLog:
    """Received datagrams with their instants, in memory and, if wanted, in a text file.

    Instants are those of arrival, by the kernel's stamp where there is one. A line of the file is
    ``<monotonic instant in ns> <bytes in hex>``; :func:`read_motion_log` reads it back.

    Attributes:
        records: The newest records: instant (CLOCK_MONOTONIC, ns) and datagram.
    """

    def __init__(self, path: Path | None = None, *, kept: int = _KEPT) -> None:
        """An empty log.

        Args:
            path: File to write, replaced if it exists; None keeps the records in memory only.
            kept: How many of the newest records stay in memory.
        """
        self.records: deque[tuple[int, bytes]] = deque(maxlen=kept)
        self._file: TextIOWrapper | None = None
        if path is not None:
            self._file = path.open("w", encoding="ascii")

    def write(self, instant_ns: int, datagram: bytes) -> None:
        """Add one datagram."""
        self.records.append((instant_ns, own_bytes(datagram)))
        if self._file is not None:
            self._file.write(f"{instant_ns} {datagram.hex()}\n")

    def close(self) -> None:
        """Close the file, if there is one; the records in memory stay."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def read_motion_log(path: Path) -> Iterator[tuple[int, bytes]]:
    """Instants [ns] and datagrams of a file written by :class:`MotionLog`.

    Raises:
        ValueError: A line is no record; says which.
    """
    with path.open(encoding="ascii") as lines:
        for number, line in enumerate(lines, start=1):
            instant, _, datagram = line.rstrip("\n").partition(" ")
            try:
                yield int(instant), bytes.fromhex(datagram)
            except ValueError as error:
                raise ValueError(
                    f"{path}, line {number}: {line.strip()[:60]!r} is no record; "
                    "a record is '<ns> <hex bytes>'"
                ) from error
