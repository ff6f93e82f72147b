"""The guard's loop: timer, platform socket, mapped files around the pure `Guard`."""

from __future__ import annotations

import asyncio
import gc
import logging
import signal
import socket
from collections import deque
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from motionserver.bounded_files import read_bounded
from motionserver.core.device import Feedback
from motionserver.core.safety.act import Guard
from motionserver.core.safety.ending import exit_status
from motionserver.core.safety.given import Request, TickInput
from motionserver.core.safety.inherit import inherit
from motionserver.core.safety.patient import slices_per_tick
from motionserver.core.safety.setpoint import Setpoint
from motionserver.core.safety.states import State
from motionserver.core.safety.will import Will, will_of
from motionserver.guard.options import GuardOptions
from motionserver.guard.ports import Ports
from motionserver.guard.send_grid import SendGrid
from motionserver.guard.snapshot import snapshot
from motionserver.telemetry.blackbox.guard_box import GuardBox
from motionserver.telemetry.logs import Seldom
from motionserver.telemetry.requests import RequestServer
from motionserver.telemetry.ticker import Lateness, Ticker, now_ns, ticks_per_send

LARGEST_SWITCH: Final = 4096
"""Largest file of the enable switch that is read [bytes]."""
SNAPSHOT_NS: Final = 30_000_000
SECOND: Final = 1_000_000_000

log = logging.getLogger("motionserver.guard")


class GuardLoop:
    """One guard on one platform."""

    def __init__(
        self, options: GuardOptions, run_dir: Path, link: socket.socket, scheduling: str
    ) -> None:
        self.options = options
        ticks = ticks_per_send(options.rate_hz)
        self._tick_ns = SECOND / (ticks * options.rate_hz)
        slices = slices_per_tick(self._tick_ns / SECOND)
        self.guard = Guard(replace(options.guard, slices=slices))
        self._box = GuardBox(run_dir, self.guard)
        self._ports = Ports(options, run_dir, link, self.guard.record.counters, self._box.accepted)
        self._requests = RequestServer(run_dir / "guard.sock")
        self._lateness = Lateness(int(self._tick_ns))
        self._leave = False
        self._seen_event = 0
        self._start_ns = self._last_ns = now_ns()
        self._grid = SendGrid(self._tick_ns, ticks, self._start_ns)
        self._tick_due_ns = 0
        self._ticks = 0
        self._sends: deque[int] = deque(maxlen=120)
        self._snapshot_ns = 0
        self._taken_ns = 0
        self._setpoint: Setpoint | None = None
        self._done: asyncio.Future[int] | None = None
        self._early: tuple[Feedback, ...] = ()
        self.scheduling = scheduling
        self._seldom = Seldom(log)

    async def run(self) -> int:
        """Run until told to leave and parked.

        Returns:
            Exit status: 0 if it ended parked or with the platform never raised, 3 otherwise.
        """
        loop = asyncio.get_running_loop()
        self._done = loop.create_future()
        loop.add_signal_handler(signal.SIGTERM, self._on_terminate)
        gc.freeze()
        gc.disable()
        ticker = Ticker(self._wake)
        self._ticker = ticker
        self._begin(now_ns())
        machine = self.guard.machine
        log.info("guard ready, limits %s of %s; %s", machine.digest, machine.name, self.scheduling)
        try:
            return await self._done
        finally:
            ticker.close()

    def _begin(self, now: int) -> None:
        """Start the clock; after another guard in its rhythm, so that no packet comes too soon."""
        self._start_ns = self._last_ns = now
        self._grid = SendGrid(self._tick_ns, ticks_per_send(self.options.rate_hz), now)
        left = self._ports.left()
        if left is not None:
            self._follow(*left, now)
        elif self._ports.has_predecessor:
            # it may have sent a packet just now
            self._grid.keep_apart(now)
        if refusal := self._requests.refusal:
            self.guard.record.note(now, refusal)
        self._arm(self._grid.first_tick(now))

    def _follow(self, will: Will, sent_ns: int | None, now: int) -> None:
        """Go on behind the guard that left ``will``; ``sent_ns`` is None if it died about it."""
        if sent_ns is None:
            # a base that answers the packet has got it, whenever that was
            self._early = self._ports.feedback()
        if inherit(self.guard, will, now, sent_ns is not None or bool(self._early)):
            self._taken_ns = now
        self._ports.sent_ns = now if sent_ns is None else sent_ns
        self._grid.resume(will.due_ns, self._ports.sent_ns, now)

    def _arm(self, instant_ns: int) -> None:
        self._tick_due_ns = instant_ns
        self._ticker.arm(instant_ns)

    def _on_terminate(self) -> None:
        why = self._ports.leave_reason()
        self.guard.supervisor.leave_reason = why
        self.ask_to_leave(why or "terminated")

    def ask_to_leave(self, why: str) -> None:
        """Park and end; asking again does not hurry it."""
        if not self._leave:
            self.guard.record.note(now_ns(), f"leaving: {why}")
        self._leave = True

    def _wake(self) -> None:
        now = now_ns()
        late = now - self._tick_due_ns
        self._lateness.ticked(late)
        self._box.ticked(late)
        self._ticks += 1
        try:
            self._step(now)
        except Exception:
            # the guard must not die of a surprise: the plan's clock pauses for this tick
            self.guard.record.counters["tick_errors"] += 1
            self._seldom.exception(now, "tick failed")
        # what this tick took may have been longer than a tick
        self._arm(self._grid.next_tick(now))

    def _step(self, now: int) -> None:
        requests = self._requests.poll()
        counters = self.guard.record.counters
        counters["request_malformed"] = self._requests.malformed
        given = TickInput(
            now_ns=now,
            gap=(now - self._last_ns) / SECOND,
            is_due=self._grid.is_due(now),
            feedback=self._early + self._ports.feedback(),
            cue=self._ports.cue(),
            proposal=self._ports.proposal(),
            requests=tuple(
                as_request(message, self.options.enable_input) for message, _ in requests
            ),
            leave=self._leave,
        )
        if given.gap > 1.5e-9 * self._tick_ns:
            counters["late_ticks"] += 1
        self._last_ns, self._early = now, ()
        setpoint, answers = self.guard.tick(given)
        is_sent = False
        if setpoint is not None:
            is_sent = self._send(setpoint, now)
        elif self._ports.has_news(self.guard.record):
            self._publish(now, self._grid.due_ns)
        if given.proposal is not self.guard.judged:
            # the black box writes a verdict into the tick it was given in
            given = replace(given, proposal=self.guard.judged)
        self._box.note(given, setpoint, answers, is_sent)
        record = self.guard.record
        for (_, address), refusal in zip(requests, answers, strict=True):
            answer = {
                "ok": not refusal,
                "state": record.state,
                "reason": refusal or self.guard.reason,
            }
            self._requests.answer(address, answer)
        self._log_events()
        if record.state is State.PARKED and self._ticks % 4096 == 0:
            gc.collect()
        self._maybe_end(now)
        is_last = self._done is not None and self._done.done()
        # a short tick has room for one of the two, a snapshot or slices of a check
        is_busy = self.guard.is_checking or self.guard.judged is not None
        if is_last or now - self._snapshot_ns > SNAPSHOT_NS * (3 if is_busy else 1):
            self._snapshot_ns = now
            self._show(now)

    def _send(self, setpoint: Setpoint, now: int) -> bool:
        """Write the will, send, tell that it was sent.

        Whenever we die, no sample is sent twice and none is left out.
        """
        grid, record = self._grid, self.guard.record
        due = grid.expected_due(now)
        record.counters["missed_slots"] += grid.take(now)
        self._sends.append(now)
        # the planner must know of an acceptance at once, or it continues the wrong parent
        self._publish(now, due)
        self._setpoint = setpoint
        self._leave_will(due)
        try:
            is_sent = self._ports.send(setpoint)
        finally:
            # by the clock read right behind the call: whatever came between is behind us
            grid.keep_apart(self._ports.sent_ns)
        self.guard.told(now, is_sent)
        if not is_sent:
            # the plan's clock stood still: what is left is the state behind the packet before
            self._leave_will(grid.due_ns)
            self._ports.settle()
        if not is_sent or grid.due_ns != due:
            self._publish(now, grid.due_ns)
        return is_sent

    def _publish(self, now: int, due: int) -> None:
        sent = self._sends[-1] if self._sends else now
        self._ports.publish(sent, now, due, self.guard.record)

    def _leave_will(self, due: int) -> None:
        newest = self.guard.supervisor.device.newest
        self._ports.leave(will_of(self.guard.record, newest, self._taken_ns, due))

    def _show(self, now: int) -> None:
        if self._setpoint is not None:
            ticks = {
                **self._lateness.summary(),
                "scheduling": self.scheduling,
                "filter": self._ports.filter,
            }
            self._ports.show(
                snapshot(self.guard, self.options, self._setpoint, ticks, self._rates(), now)
            )

    def _rates(self) -> dict[str, float]:
        sends = self._sends
        span = (sends[-1] - sends[0]) / SECOND if len(sends) > 1 else 0.0
        return {
            "tick": round(SECOND / self._tick_ns, 3),
            "send": round((len(sends) - 1) / span, 3) if span else 0.0,
        }

    def _log_events(self) -> None:
        record = self.guard.record
        for when, text in record.events:
            if when > self._seen_event:
                log.info("%s", text)
        if record.events:
            self._seen_event = record.events[-1][0]

    def _maybe_end(self, now: int) -> None:
        """Leave once it is down, was never raised, or could not be brought down in its time."""
        if not self._leave or self._done is None or self._done.done():
            return
        guard = self.guard
        status = exit_status(guard.record, guard.supervisor.device, self._start_ns, now)
        if status is not None:
            self._done.set_result(status)


def as_request(message: dict[str, Any], enable_input: Path | None) -> Request:
    """An edge; a word that is none is not kept, so that nobody can fill the counters with words."""
    op = message["op"] if message["op"] in ("engage", "park", "reset") else "unknown"
    enabled = True
    if op == "engage" and enable_input is not None:
        try:
            # a named pipe or a device would keep the guard waiting: not read, so not enabled
            enabled = read_bounded(enable_input, LARGEST_SWITCH).strip() == b"1"
        except OSError:
            enabled = False
    return Request(op, str(message.get("by", "console"))[:20], enabled)
