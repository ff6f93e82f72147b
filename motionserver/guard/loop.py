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
from motionserver.core.safety.given import Request, TickInput
from motionserver.core.safety.inherit import inherit
from motionserver.core.safety.patient import slices_per_tick
from motionserver.core.safety.setpoint import Setpoint
from motionserver.core.safety.states import RAISED, State
from motionserver.core.safety.supervisor import is_standing
from motionserver.core.safety.will import will_of
from motionserver.guard.options import GuardOptions
from motionserver.guard.ports import Ports
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
        self._ticks_per_send = ticks_per_send(options.rate_hz)
        self._tick_ns = SECOND / (self._ticks_per_send * options.rate_hz)
        slices = slices_per_tick(self._tick_ns / SECOND)
        self.guard = Guard(replace(options.guard, slices=slices))
        self._box = GuardBox(run_dir, self.guard)
        self._ports = Ports(options, run_dir, link, self.guard.record.counters, self._box.accepted)
        self._requests = RequestServer(run_dir / "guard.sock")
        self._lateness = Lateness(int(self._tick_ns))
        self._leave = False
        self._seen_event = 0
        self._last_ns = 0
        self._tick = 0
        self._sent_slot = -1
        self._sends: deque[int] = deque(maxlen=120)
        self._snapshot_ns = 0
        self._taken_ns = 0
        self._setpoint: Setpoint | None = None
        self._done: asyncio.Future[int] | None = None
        self._early: tuple[Feedback, ...] = ()
        self._start_ns = now_ns()
        self.scheduling = scheduling
        self._seldom = Seldom(log)

    async def run(self) -> int:
        """Run until told to leave and parked.

        Returns:
            Exit status: 0 if it ended parked or with the platform never raised, 3 otherwise.
        """
        loop = asyncio.get_running_loop()
        self._done = loop.create_future()
        loop.add_signal_handler(signal.SIGTERM, self.ask_to_leave, "terminated")
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        gc.freeze()
        gc.disable()
        ticker = Ticker(self._wake)
        self._begin(now_ns())
        self._ticker = ticker
        ticker.arm(int(self._start_ns + (self._tick + 1) * self._tick_ns))
        machine = self.guard.machine
        log.info("guard ready, limits %s of %s; %s", machine.digest, machine.name, self.scheduling)
        try:
            return await self._done
        finally:
            ticker.close()

    def _begin(self, now: int) -> None:
        """Start the clock; after another guard in its rhythm, so that no packet comes too soon."""
        self._start_ns = self._last_ns = now
        left = self._ports.left()
        if left is None:
            return
        will, is_sent = left
        if not is_sent:
            # it died about its packet; a base that answers it has got it
            self._early = self._ports.feedback()
            is_sent = bool(self._early)
        if inherit(self.guard, will, now, is_sent):
            self._taken_ns = now
        send_ns = self._ticks_per_send * self._tick_ns
        slots = (now - will.due_ns) // send_ns + 1
        self.guard.record.counters["missed_slots"] += max(0, int(slots))
        # slot 0 is the one the guard before has sent in, or missed
        self._start_ns = int(will.due_ns + (slots - 1) * send_ns)
        self._tick, self._sent_slot = int((now - self._start_ns) / self._tick_ns), 0

    def ask_to_leave(self, why: str) -> None:
        """Park and end; asking again does not hurry it."""
        if not self._leave:
            self.guard.record.note(now_ns(), f"leaving: {why}")
        self._leave = True

    def _wake(self) -> None:
        now = now_ns()
        slot = int((now - self._start_ns) / self._tick_ns)
        late = int(now - self._start_ns - (self._tick + 1) * self._tick_ns)
        self._lateness.ticked(late)
        self._box.ticked(late)
        self._tick = slot
        try:
            self._step(now, slot)
        except Exception:
            # the guard must not die of a surprise: the plan's clock pauses for this tick
            self.guard.record.counters["tick_errors"] += 1
            self._seldom.exception(now, "tick failed")
        self._ticker.arm(int(self._start_ns + (slot + 1) * self._tick_ns))

    def _step(self, now: int, slot: int) -> None:
        send_slot = slot // self._ticks_per_send
        is_due = send_slot != self._sent_slot
        requests = self._requests.poll()
        counters = self.guard.record.counters
        counters["request_malformed"] = self._requests.malformed
        given = TickInput(
            now_ns=now,
            gap=(now - self._last_ns) / SECOND,
            is_due=is_due,
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
        if setpoint is not None:
            if self._sent_slot >= 0:
                counters["missed_slots"] += send_slot - self._sent_slot - 1
            self._sent_slot = send_slot
            self._sends.append(now)
        due = int(self._start_ns + (send_slot + 1) * self._ticks_per_send * self._tick_ns)
        # the planner must know of an acceptance at once, or it continues the wrong parent
        if setpoint is not None or self._ports.has_news(self.guard.record):
            sent = self._sends[-1] if self._sends else now
            self._ports.publish(sent, now, due, self.guard.record)
        is_sent = setpoint is not None and self._send(setpoint, now, due)
        if given.proposal is not self.guard.judged:
            # the black box writes a verdict into the tick it was given in
            given = replace(given, proposal=self.guard.judged)
        self._box.note(given, setpoint, answers, is_sent)
        record = self.guard.record
        for (_, address), refusal in zip(requests, answers, strict=True):
            answer = {"ok": not refusal, "state": record.state, "reason": refusal or record.reason}
            self._requests.answer(address, answer)
        self._log_events()
        if record.state is State.PARKED and slot % 4096 == 0:
            gc.collect()
        self._maybe_end(now)
        is_last = self._done is not None and self._done.done()
        # a short tick has room for one of the two, a snapshot or slices of a check
        is_busy = self.guard.is_checking or self.guard.judged is not None
        if is_last or now - self._snapshot_ns > SNAPSHOT_NS * (3 if is_busy else 1):
            self._snapshot_ns = now
            self._show(now)

    def _send(self, setpoint: Setpoint, now: int, due: int) -> bool:
        """Write the will, send, tell that it was sent.

        Whenever we die, no sample is sent twice and none is left out.
        """
        self._setpoint = setpoint
        self._leave_will(due)
        is_sent = self._ports.send(setpoint)
        self.guard.told(now, is_sent)
        if not is_sent:
            # the plan's clock stood still: what is left is the state behind the packet before
            self._leave_will(due)
            self._ports.settle()
        return is_sent

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
        """Leave once nothing moves: parked, never raised, or standing in a fault."""
        record = self.guard.record
        if not self._leave or self._done is None or self._done.done():
            return
        offline = record.state is State.OFFLINE and now - self._start_ns > SECOND
        if record.state is State.PARKED or offline:
            self._done.set_result(0)
        elif record.state not in RAISED | {State.OFFLINE} and is_standing(record.playback):
            self._done.set_result(3)


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
