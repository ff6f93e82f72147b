"""The small records that planner and guard exchange through mapped files."""

from __future__ import annotations

import struct
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Final

from motionserver.core.motion.player import MOST_PENDING
from motionserver.core.plan import MAX_KNOTS
from motionserver.core.safety.states import State
from motionserver.core.safety.verdict import Reason
from motionserver.core.safety.watchdog import CueStatus
from motionserver.core.state import DriveMode
from motionserver.telemetry.cue_history import make_cue_history
from motionserver.telemetry.mapped import MappedFile
from motionserver.telemetry.run_files import located
from motionserver.telemetry.trace import TRACE_BYTES

STATES: Final = tuple(State)
REASONS: Final = tuple(Reason)
_CLOCK: Final = struct.Struct("<BQdQQQQQBBQ")
_CUE: Final = struct.Struct("<QQBQQ")
_TROUBLE_BYTES: Final = 300
"""Longest sentence about the source's packets [bytes of UTF-8]."""
SENT: Final = struct.Struct("<QQ")
SESSIONS_BYTES: Final = 16 * 8
"""Room for the signed sessions that a planner leaves to the next one."""
PLAN_BYTES: Final = 64 + 2 * MAX_KNOTS * 19 * 8
_WILL_BYTES: Final = 16384 + (2 + MOST_PENDING) * PLAN_BYTES


@dataclass(frozen=True, slots=True)
class GuardClock:
    """What the planner must know of the guard, written at every send and every verdict.

    Attributes:
        state: Index of the motion state in `STATES`.
        newest_id: Number of the newest accepted plan; 0 = none.
        newest_clock: That plan's own time at the last send [s]; negative while it waits.
        sent_ns: When the last packet was sent [ns].
        due_ns: When the next one is due [ns].
        written_ns: When this was written [ns].
        taken_id: Number of the newest proposal that was read; 0 = none.
        judged_id: Number of the newest proposal that was decided about; 0 = none.
        refusal: Why that one was refused, as 1 + its index in `REASONS`; 0 = accepted.
        waiting: Accepted plans that wait for their instant.
        late_count: Proposals that were refused as too late since the start.
    """

    state: int
    newest_id: int
    newest_clock: float
    sent_ns: int
    due_ns: int
    written_ns: int
    taken_id: int = 0
    judged_id: int = 0
    refusal: int = 0
    waiting: int = 0
    late_count: int = 0

    @property
    def refused_because(self) -> Reason | None:
        """Why the newest proposal that was decided about was refused; None if it was not."""
        return None if self.refusal == 0 else REASONS[self.refusal - 1]

    def pack(self) -> bytes:
        """Write as bytes."""
        return _CLOCK.pack(*astuple(self))

    @classmethod
    def unpack(cls, data: bytes) -> GuardClock:
        """Read what `pack` wrote."""
        return cls(*_CLOCK.unpack(data))


def pack_cue(status: CueStatus, now_ns: int) -> bytes:
    """Write what the planner knows of the source, looked at ``now_ns``; long sentences are cut."""
    head = _CUE.pack(status.newest_ns, status.stale_after_ns, status.mode, now_ns, status.heard_ns)
    return head + status.trouble.encode("utf-8", "replace")[:_TROUBLE_BYTES]


def unpack_cue(data: bytes) -> CueStatus:
    """Read what `pack_cue` wrote.

    Raises:
        ValueError: The mode is unknown, or the sentence is too long.
        struct.error: It is too short.
    """
    newest, stale_after, mode, looked, heard = _CUE.unpack_from(data)
    trouble = data[_CUE.size :]
    if len(trouble) > _TROUBLE_BYTES:
        raise ValueError(f"a sentence of {len(trouble)} bytes, allowed {_TROUBLE_BYTES}")
    words = "".join(c if c.isprintable() else " " for c in trouble.decode("utf-8", "ignore"))
    return CueStatus(newest, stale_after, DriveMode(mode), heard, words, looked)


class Maps:
    """The mapped files of one run.

    Attributes:
        proposal: Planner to guard: the newest proposed plan.
        accepted: Guard to planner: the newest accepted plan.
        clock: Guard to planner: `GuardClock`.
        cue: Planner to guard: the source's status.
        will: Guard to its successor: `core.safety.will.Will`, before every packet.
        sent: Guard to its successor: sequence of the will whose packet went out, and when it had
            gone out at the latest, right after it.
        guard: Guard to page: snapshot as JSON.
        planner: Planner to page: snapshot as JSON.
        service: Supervisor to page: processes as JSON.
        page: Page to supervisor: empty messages, as a sign of life.
        trace: Planner to a recorder: `trace.Trace`, every period.

    Where they are made, so is the history of believed packets, see `cue_history`.
    """

    def __init__(self, run_dir: Path, create: bool = False) -> None:
        def opened(name: str, capacity: int) -> MappedFile:
            return MappedFile(located(run_dir, f"{name}.map"), capacity if create else None)

        self.proposal = opened("proposal", PLAN_BYTES)
        self.accepted = opened("accepted", PLAN_BYTES)
        self.clock = opened("clock", _CLOCK.size)
        self.cue = opened("cue", _CUE.size + _TROUBLE_BYTES)
        self.will = opened("will", _WILL_BYTES)
        self.sent = opened("sent", SENT.size)
        self.guard = opened("guard", 32768)
        self.planner = opened("planner", 32768)
        self.service = opened("service", 8192)
        self.page = opened("page", 0)
        self.trace = opened("trace", TRACE_BYTES)
        if create:
            make_cue_history(run_dir)

    def close(self) -> None:
        """Unmap all."""
        for mapped in vars(self).values():
            mapped.close()
