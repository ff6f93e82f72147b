"""What the planner leaves for the black box: packets, periods, proposals, counters."""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Final

from motionserver.core.state import VehicleMotion
from motionserver.telemetry.blackbox.history import History, open_history
from motionserver.telemetry.blackbox.records import PACKET
from motionserver.telemetry.blackbox.room import FOLDER
from motionserver.telemetry.run_files import located

COUNT_NS: Final = 1_000_000_000
"""Time between two notes of all counters [ns]."""
_WORD: Final = (1 << 64) - 1


class PlannerBox:
    """Notes what one planner hears and thinks; without histories it does nothing.

    Args:
        run_dir: Where the histories lie.
    """

    def __init__(self, run_dir: Path) -> None:
        self._packets = open_history(located(run_dir, f"{FOLDER}/packets.history"))
        self._periods = open_history(located(run_dir, f"{FOLDER}/periods.history"))
        self._proposed = open_history(located(run_dir, f"{FOLDER}/proposed.history"))
        self._events = open_history(located(run_dir, f"{FOLDER}/planner_events.history"))
        self._counted_ns = 0
        self._unreadable = 0

    def packets(self, believed: Iterable[VehicleMotion]) -> None:
        """Note packets that were believed."""
        if self._packets is None:
            return
        try:
            for motion in believed:
                self._packets.write(_packed(motion))
        except (ValueError, struct.error):
            # a third party's format that fills a field with something else costs its own row
            self._unreadable += 1

    def proposed(self, packed: bytes) -> None:
        """Note a proposal."""
        _put(self._proposed, packed)

    def period(self, trace: bytes) -> None:
        """Note a period, as `telemetry.trace` writes it."""
        _put(self._periods, trace)

    def count(self, now_ns: int, tell: Callable[[], Mapping[str, Any]]) -> None:
        """Once a second, note what ``tell`` says of source and counters."""
        if self._events is None or now_ns - self._counted_ns < COUNT_NS:
            return
        event = {
            "t_ns": now_ns,
            "what": "counters",
            "pid": os.getpid(),
            "not_boxed": self._unreadable,
            **tell(),
        }
        self._counted_ns = now_ns
        self._events.write(json.dumps(event, separators=(",", ":")).encode())


def _packed(motion: VehicleMotion) -> bytes:
    return PACKET.pack(
        motion.arrival_ns,
        -1 if motion.sender_ns is None else motion.sender_ns & (_WORD >> 1),
        motion.session & _WORD,
        -1 if motion.sequence is None else motion.sequence & (_WORD >> 1),
        motion.mode,
        motion.at_platform,
        *motion.force.tolist(),
        *motion.rates.tolist(),
        motion.speed,
    )


def _put(history: History | None, data: bytes) -> None:
    if history is not None:
        history.write(data)
