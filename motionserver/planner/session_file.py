"""Where signed sessions are remembered over a restart: a small file, written beside the ticks."""

from __future__ import annotations

import contextlib
import logging
import os
import struct
from collections import Counter
from collections.abc import Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Final
from zlib import crc32

from motionserver.bounded_files import MIB, read_bounded
from motionserver.planner.options import PlannerOptions
from motionserver.planner.sessions import MOST, Sessions
from motionserver.telemetry.link import SESSIONS_BYTES
from motionserver.telemetry.mapped import MappedFile
from motionserver.telemetry.run_files import located

_MAGIC: Final = b"MCSESS01"
_HEAD: Final = struct.Struct("<8sII")
"""Magic, number of sessions, CRC-32 of what follows."""
LARGEST_FILE: Final = MIB
_PAIR: Final = struct.Struct("<II")
_RECENT: Final = SESSIONS_BYTES // _PAIR.size
"""Sessions whose marks a planner that was killed leaves to the next one."""

log = logging.getLogger("motionserver.planner")


class SessionKeeper:
    """The sessions, kept.

    In the state directory the file is written when a session begins, by a thread of its own, and
    says of it that it is over: after a power cut nothing of it is believed. A soft end writes how
    far it came, so that a client which outlives the server goes on. A planner that is killed
    leaves that in memory that the service made, which costs a tick microseconds.

    Args:
        file: In the state directory.
        recent: Mapped file of the run; gone after a restart of the service.

    Attributes:
        counters: What went wrong, for the page.
    """

    def __init__(self, file: Path, recent: Path) -> None:
        self._file = file
        self.counters: Counter[str] = Counter()
        kept = self._kept()
        self._recent = MappedFile(recent, _RECENT * _PAIR.size)
        left = self._recent.read()
        if left is not None:
            kept |= dict(_PAIR.iter_unpack(left[1]))
        self.sessions = Sessions(kept.items())
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="sessions")
        self._writing: Future[None] | None = None
        self._begun = self._heard = False

    def hear(self, session: int, sequence: int) -> int:
        """As `Sessions.hear`, and remembered by the next `keep`."""
        self._begun |= self.sessions.is_new(session)
        self._heard = True
        return self.sessions.hear(session, sequence)

    def keep(self) -> None:
        """Once a period: what was heard goes to memory, a session that began to the thread."""
        if self._heard:
            self._heard = False
            self._recent.write(_joined(self.sessions.newest(_RECENT)))
        if self._begun and (self._writing is None or self._writing.done()):
            self._begun = False
            marks = self.sessions.marks(may_go_on=False)
            self._writing = self._thread.submit(self._write, marks)

    def close(self) -> None:
        """Write how far each session came; nothing is heard any more."""
        self._thread.shutdown()
        self._write(self.sessions.marks(may_go_on=True))
        self._recent.close()

    def _kept(self) -> dict[int, int]:
        try:
            return unpacked(read_bounded(self._file, LARGEST_FILE))
        except FileNotFoundError:
            return {}
        except (OSError, ValueError) as error:
            self.counters["sessions_damaged"] += 1
            aside = self._file.with_name(self._file.name + ".damaged")
            log.error(
                "%s: %s. Which signed sessions were heard before is not known any more, so that "
                "recordings of them could be played again: give [[sources]] key_file a new key. "
                "A fresh file is begun; the old one is put aside as %s",
                self._file, error, aside.name,
            )  # fmt: skip
            with contextlib.suppress(OSError):
                self._file.replace(aside)
            return {}

    def _write(self, marks: list[tuple[int, int]]) -> None:
        temporary = self._file.with_name(self._file.name + ".new")
        try:
            self._file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            with temporary.open("wb") as stream:
                os.fchmod(stream.fileno(), 0o600)
                stream.write(packed(marks))
                stream.flush()
                os.fsync(stream.fileno())
            temporary.replace(self._file)
        except OSError as error:
            self.counters["sessions_unsaved"] += 1
            if self.counters["sessions_unsaved"] == 1:
                log.error("%s: %s: signed sessions are forgotten at a restart", self._file, error)


def keeper_of(options: PlannerOptions, run_dir: Path) -> SessionKeeper | None:
    """The keeper of a planner that has sources with keys; None without any."""
    if not any(one.key for one in options.inputs):
        return None
    return SessionKeeper(options.sessions_file, located(run_dir, "sessions.map"))


def packed(marks: Iterable[tuple[int, int]]) -> bytes:
    """The bytes of the file."""
    body = _joined(marks)
    return _HEAD.pack(_MAGIC, len(body) // _PAIR.size, crc32(body)) + body


def unpacked(data: bytes) -> dict[int, int]:
    """The marks in the bytes of a file.

    Raises:
        ValueError: They are not what `packed` made.
    """
    body = data[_HEAD.size :]
    if len(data) < _HEAD.size or data[:8] != _MAGIC:
        raise ValueError("not a file of sessions")
    _, count, checksum = _HEAD.unpack_from(data)
    if count > MOST or len(body) != count * _PAIR.size or crc32(body) != checksum:
        raise ValueError("damaged: its checksum or length differs")
    return dict(_PAIR.iter_unpack(body))


def _joined(marks: Iterable[tuple[int, int]]) -> bytes:
    return b"".join(_PAIR.pack(*one) for one in marks)
