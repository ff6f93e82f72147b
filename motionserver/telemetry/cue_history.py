"""The newest believed packets with all they said, from the planner to a recorder.

The black box keeps a minute of their fixed part; a recorder also wants what the sender told ahead
and what the driver did, and reads them within moments.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

import numpy as np

from motionserver.core.axes import frozen
from motionserver.core.state import DriveMode, Driver, Preview, VehicleMotion
from motionserver.telemetry.blackbox.history import History, open_history
from motionserver.telemetry.run_files import located

_FILE: Final = "cues.map"
_KEPT: Final = 1024  # four seconds of the fastest sender
MOST_AHEAD: Final = 80
"""Instants of a preview that are kept, twice what a packet can carry."""
_FIXED: Final = struct.Struct("<QQqqQB7d?2d?4dbB")
CUE_BYTES: Final = _FIXED.size + MOST_AHEAD * 7 * 8
_WORD: Final = (1 << 64) - 1
_NO_DRIVER: Final = Driver(0.0, 0.0, 0.0, 0.0, 0)


def pack_cue(motion: VehicleMotion) -> bytes:
    """Write a packet.

    Raises:
        struct.error: A third party's format filled a field with something else.
    """
    told = _NO_DRIVER if motion.driver is None else motion.driver
    ahead = b""
    count = 0
    if motion.preview is not None:
        table = np.column_stack((motion.preview.times, motion.preview.force, motion.preview.rates))[
            :MOST_AHEAD
        ]
        count, ahead = len(table), np.ascontiguousarray(table, dtype="<f8").tobytes()
    return (
        _FIXED.pack(
            motion.arrival_ns,
            motion.session & _WORD,
            -1 if motion.sequence is None else motion.sequence & (_WORD >> 1),
            -1 if motion.sender_ns is None else motion.sender_ns & (_WORD >> 1),
            motion.sim_time_ns & _WORD,
            motion.mode,
            *motion.force.tolist(),
            *motion.rates.tolist(),
            motion.speed,
            motion.attitude is not None,
            *(motion.attitude or (0.0, 0.0)),
            motion.driver is not None,
            told.throttle,
            told.brake,
            told.clutch,
            told.steering,
            min(max(told.gear, -128), 127),
            count,
        )
        + ahead
    )


def unpack_cue(data: bytes) -> VehicleMotion:
    """Read what `pack_cue` wrote.

    Raises:
        ValueError: It is something else.
    """
    try:
        values = _FIXED.unpack_from(data)
        count = values[-1]
        table = np.frombuffer(data, dtype="<f8", offset=_FIXED.size).reshape(count, 7)
        mode = DriveMode(values[5])
    except (struct.error, ValueError) as error:
        raise ValueError(f"not a packet of this version: {error}") from error
    arrival, session, sequence, sender, sim_time = values[:5]
    preview = None
    if count:
        preview = Preview(frozen(table[:, 0]), frozen(table[:, 1:4]), frozen(table[:, 4:7]))
    return VehicleMotion(
        arrival_ns=arrival,
        session=session,
        sequence=None if sequence < 0 else sequence,
        sender_ns=None if sender < 0 else sender,
        force=frozen(values[6:9]),
        rates=frozen(values[9:12]),
        speed=values[12],
        mode=mode,
        preview=preview,
        driver=_driver(values[17:22]) if values[16] else None,
        sim_time_ns=sim_time,
        attitude=(values[14], values[15]) if values[13] else None,
    )


def _driver(values: tuple[Any, ...]) -> Driver:
    throttle, brake, clutch, steering, gear = values
    return Driver(throttle, brake, clutch, steering, gear)


def make_cue_history(run_dir: Path) -> None:
    """Make an empty one.

    Raises:
        OSError: There is no room, or the folder cannot be written.
    """
    History.create(run_dir / _FILE, CUE_BYTES, _KEPT).close()


class CueNotes:
    """Notes the vehicle's believed packets; without a history it does nothing.

    Args:
        run_dir: Where the processes meet.
    """

    def __init__(self, run_dir: Path) -> None:
        self._history = open_history(located(run_dir, _FILE))
        self.unreadable = 0

    def note(self, believed: Iterable[VehicleMotion]) -> None:
        """Note packets; one with a field of another kind costs its own row."""
        if self._history is None:
            return
        for motion in believed:
            try:
                self._history.write(pack_cue(motion))
            except (ValueError, TypeError, struct.error):
                self.unreadable += 1


class CueReader:
    """Reads believed packets as they come; each once, as long as it keeps up.

    Attributes:
        missed: Packets that were overwritten before they were read.
        kept: Packets that were there already when it was opened.

    Args:
        run_dir: Where the processes meet.
    """

    def __init__(self, run_dir: Path) -> None:
        self._history = open_history(located(run_dir, _FILE))
        self._seen = 0
        self.missed = 0
        self.kept = self.new()
        self.missed = 0

    def new(self) -> list[VehicleMotion]:
        """Packets since the last call, oldest first."""
        if self._history is None or self._history.newest_sequence() == self._seen:
            return []
        out = []
        for number, data in self._history.since(self._seen):
            self.missed += number - self._seen - 1
            self._seen = number
            try:
                out.append(unpack_cue(data))
            except ValueError:
                self.missed += 1
        return out
