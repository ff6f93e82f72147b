"""What the guard leaves for the black box: rows and events into mapped memory, never a file."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

from motionserver.core.plan import Plan
from motionserver.core.safety.act import Guard
from motionserver.core.safety.given import TickInput
from motionserver.core.safety.setpoint import Setpoint
from motionserver.core.safety.states import State
from motionserver.telemetry.blackbox.history import open_history
from motionserver.telemetry.blackbox.records import GUARD, ORDERS, PHASES, STATES, VERDICTS
from motionserver.telemetry.blackbox.room import FOLDER
from motionserver.telemetry.run_files import located

COUNT_NS: Final = 1_000_000_000
"""Time between two notes of all counters [ns]."""
MOST_REQUESTS: Final = 8
"""Different requests noted per second."""
_NAN: Final = float("nan")
_SIX: Final = (_NAN,) * 6


class GuardBox:
    """Notes what one guard does; without histories it does nothing.

    Args:
        run_dir: Where the histories lie.
        guard: Who is watched.
    """

    def __init__(self, run_dir: Path, guard: Guard) -> None:
        self._guard = guard
        self._rows = open_history(located(run_dir, f"{FOLDER}/guard.history"))
        self._events = open_history(located(run_dir, f"{FOLDER}/guard_events.history"))
        self._plans = open_history(located(run_dir, f"{FOLDER}/accepted.history"))
        self._state: State | None = None
        self._seen_event = 0
        self._late_ns = self._ticks = 0
        self._counted_ns = 0
        self._requests: set[tuple[str, str, str]] = set()
        self._device: tuple[str, tuple[str, ...], bool] = ("", (), False)
        self._last: Setpoint | None = None

    def ticked(self, late_ns: int) -> None:
        """Note how late a tick is [ns]; before the tick."""
        if self._state is None:
            # a successor begins in the state, and with the events, of the guard before it
            record = self._guard.record
            self._state = record.state
            self._seen_event = record.events[-1][0] if record.events else 0
        self._late_ns = max(self._late_ns, late_ns)
        self._ticks += 1

    def accepted(self, packed: bytes) -> None:
        """Note a plan that was accepted."""
        if self._plans is not None:
            with self._harmless():
                self._plans.write(packed)

    def note(
        self, given: TickInput, setpoint: Setpoint | None, answers: Sequence[str], is_sent: bool
    ) -> None:
        """Note one tick.

        Args:
            given: What came in.
            setpoint: What was to be sent, if anything.
            answers: One per request, empty = granted.
            is_sent: False if the network refused it.
        """
        if self._events is None or self._rows is None:
            return
        self._last = setpoint or self._last
        with self._harmless():
            self._note_events(given, answers)
            if self._last is not None and (setpoint is not None or given.proposal is not None):
                self._rows.write(self._row(given, self._last, setpoint is not None and is_sent))
                self._late_ns = self._ticks = 0

    @contextlib.contextmanager
    def _harmless(self) -> Iterator[None]:
        """Whatever goes wrong in here is counted; the tick goes on."""
        try:
            yield
        except Exception:
            self._guard.record.counters["blackbox_errors"] += 1

    def _row(self, given: TickInput, setpoint: Setpoint, is_sent: bool) -> bytes:
        record, supervisor = self._guard.record, self._guard.supervisor
        playback, newest = record.playback, supervisor.device.newest
        status = supervisor.source.status
        measured, kind = _SIX, 0
        if newest is not None and newest.legs is not None:
            measured, kind = tuple(newest.legs.tolist()), 1
        elif newest is not None and newest.pose is not None:
            measured, kind = tuple(newest.pose.tolist()), 2
        return GUARD.pack(
            given.now_ns,
            STATES.index(record.state),
            ORDERS.index(setpoint.order),
            is_sent,
            max(0, self._late_ns),
            self._ticks,
            0 if playback is None else playback.playing.plan.plan_id,
            _NAN if playback is None else playback.clock,
            0 if playback is None else playback.newest.plan.plan_id,
            *self._verdict(given.proposal, given.now_ns),
            status.newest_ns,
            status.stale_after_ns,
            status.mode,
            0 if newest is None else newest.arrival_ns,
            0 if newest is None else PHASES.index(newest.phase),
            newest is not None and newest.estop,
            supervisor.device.error,
            *setpoint.state.pose.tolist(),
            *setpoint.state.velocity.tolist(),
            *setpoint.legs.tolist(),
            kind,
            *measured,
        )

    def _verdict(
        self, proposal: Plan | None, now_ns: int
    ) -> tuple[int, int, float, int, float, float]:
        if proposal is None:
            return 0, 0, _NAN, -1, _NAN, _NAN
        rejections = self._guard.record.rejections
        if not rejections or rejections[-1][0] != now_ns:
            return proposal.plan_id, 1, _NAN, -1, _NAN, _NAN
        why = rejections[-1][1]
        return (
            proposal.plan_id,
            VERDICTS.index(why.reason),
            _NAN if why.when is None else why.when,
            -1 if why.leg is None else why.leg,
            _NAN if why.value is None else why.value,
            _NAN if why.allowed is None else why.allowed,
        )

    def _note_events(self, given: TickInput, answers: Sequence[str]) -> None:
        record, now = self._guard.record, given.now_ns
        if not self._counted_ns:
            self._event(now, "guard", pid=os.getpid())
        before, self._state = self._state or State.OFFLINE, record.state
        said = ""
        if record.state is not before:
            said = f"{before} -> {record.state}: {record.reason}"
            self._event(now, "state", before=before, state=record.state, reason=record.reason)
        if record.events and record.events[-1][0] > self._seen_event:
            for when, text in record.events:
                if when > self._seen_event and text != said:
                    self._event(when, "note", text=text)
            self._seen_event = record.events[-1][0]
        for request, refusal in zip(given.requests, answers, strict=False):
            said_by = (request.op, request.by, refusal)
            # whoever repeats himself cannot wash out what was: the guard counts all of it
            if said_by not in self._requests and len(self._requests) < MOST_REQUESTS:
                self._requests.add(said_by)
                self._event(now, "request", op=request.op, by=request.by, refusal=refusal)
        newest = self._guard.supervisor.device.newest
        if newest is not None:
            device = (newest.state, newest.faults, newest.estop)
            if device != self._device:
                self._device = device
                self._event(now, "device", state=device[0], faults=device[1], estop=device[2])
        if said or now - self._counted_ns > COUNT_NS:
            self._counted_ns = now
            self._requests.clear()
            self._event(now, "counters", counters=record.counters)

    def _event(self, now_ns: int, what: str, **more: Any) -> None:  # noqa: ANN401  (any JSON)
        if self._events is not None:
            self._events.write(
                json.dumps({"t_ns": now_ns, "what": what, **more}, separators=(",", ":")).encode()
            )
