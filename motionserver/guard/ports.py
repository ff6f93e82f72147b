"""What the guard reads and writes: the platform's socket and the mapped files."""

from __future__ import annotations

import contextlib
import json
import os
import socket
import struct
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Final

from motionserver.core.device import Feedback
from motionserver.core.plan import Plan, unpack
from motionserver.core.safety.record import GuardRecord
from motionserver.core.safety.setpoint import Setpoint
from motionserver.core.safety.verdict import Reason
from motionserver.core.safety.watchdog import CueStatus
from motionserver.core.safety.will import Will, WillWriter, unpack_will
from motionserver.guard.options import GuardOptions
from motionserver.platforms.base import PlatformPacketError
from motionserver.platforms.registry import make_platform
from motionserver.telemetry.link import REASONS, SENT, STATES, GuardClock, Maps, unpack_cue
from motionserver.telemetry.sieve import dropped, sieve
from motionserver.telemetry.ticker import now_ns

DRAIN: Final = 64


class Ports:
    """All that comes in and goes out of the guard, but for requests."""

    def __init__(
        self,
        options: GuardOptions,
        run_dir: Path,
        link: socket.socket,
        counters: Counter[str],
        keep: Callable[[bytes], None] = lambda _: None,
    ) -> None:
        self._format = make_platform(options.format, options.options)
        self._peer = options.peer
        self._link = link
        self._counters = counters
        self._maps = Maps(run_dir)
        self._seen_proposal = self._maps.proposal.newest_sequence()
        self._seen_cue = 0
        self._accepted_id = 0
        self.sent_ns = 0
        """When the last packet had gone out, at the latest [ns]."""
        self._taken_id = 0
        self._told_of = (0, 0)
        self._keep = keep
        self._writer = WillWriter()
        # strangers are dropped in the kernel: a flood leaves the buffer to the platform's answers
        refusal = sieve(link, [options.peer])
        self.filter = f"none: {refusal}" if refusal else f"{options.peer[0]} alone"
        self._dropped = dropped(link)

    def feedback(self) -> tuple[Feedback, ...]:
        """Answers of the device that wait, at most `DRAIN`; everything else is counted."""
        out: list[Feedback] = []
        counters = self._counters
        lost = dropped(self._link)
        if lost != self._dropped:
            counters["feedback_foreign"] += lost - self._dropped
            self._dropped = lost
        for _ in range(DRAIN):
            try:
                data, peer = self._link.recvfrom(2048)
            except (BlockingIOError, ConnectionError):
                break
            if peer[0] != self._peer[0] or peer[1] != self._peer[1]:
                counters["feedback_foreign"] += 1
                continue
            try:
                out.append(self._format.decode(data, now_ns()))
                counters["feedback"] += 1
            except PlatformPacketError as error:
                counters[error.reason] += 1
        return tuple(out)

    def cue(self) -> CueStatus | None:
        """The planner's newest word about the source, if it is new."""
        if self._maps.cue.newest_sequence() == self._seen_cue:
            return None
        message = self._maps.cue.read()
        if message is None:
            return None
        self._seen_cue = message[0]
        try:
            return unpack_cue(message[1])
        except (ValueError, struct.error):
            self._counters["cue_malformed"] += 1
            return None

    def proposal(self) -> Plan | None:
        """The planner's newest proposal, if it is new."""
        if self._maps.proposal.newest_sequence() == self._seen_proposal:
            return None
        message = self._maps.proposal.read()
        if message is None:
            return None
        self._seen_proposal = message[0]
        try:
            plan = unpack(message[1])
        except ValueError:
            self._counters["rejected_malformed"] += 1
            self._counters["plans_rejected"] += 1
            return None
        self._taken_id = plan.plan_id
        return plan

    def has_news(self, record: GuardRecord) -> bool:
        """True if a plan was taken, decided about or accepted, and the planner was not told."""
        playback = record.playback
        is_new = playback is not None and playback.newest.plan.plan_id != self._accepted_id
        return is_new or (self._taken_id, record.judged_id) != self._told_of

    def publish(self, sent: int, now: int, due: int, record: GuardRecord) -> None:
        """Tell the planner what is accepted and what was decided, before the packet goes out."""
        playback = record.playback
        newest = None if playback is None else playback.newest.plan
        if newest is not None and newest.plan_id != self._accepted_id:
            packed = self._writer.plan(newest)
            self._maps.accepted.write(packed)
            self._keep(packed)
            self._accepted_id = newest.plan_id
        self._told_of = (self._taken_id, record.judged_id)
        self._maps.clock.write(
            GuardClock(
                STATES.index(record.state),
                0 if newest is None else newest.plan_id,
                0.0 if playback is None else playback.newest_clock,
                sent,
                due,
                now,
                self._taken_id,
                record.judged_id,
                0 if record.refusal is None else 1 + REASONS.index(record.refusal),
                0 if playback is None else len(playback.pending),
                record.counters[f"rejected_{Reason.TOO_LATE}"],
            ).pack()
        )

    def send(self, setpoint: Setpoint) -> bool:
        """Send a setpoint to the platform; what the network refuses is counted, and False."""
        try:
            self._link.sendto(self._format.encode(setpoint), self._peer)
        except OSError:
            self._counters["send_errors"] += 1
            return False
        self.sent_ns = now_ns()
        self.settle()
        self._counters["packets_sent"] += 1
        return True

    def settle(self) -> None:
        """Tell a successor that the packet of the newest will has gone out."""
        self._maps.sent.write(SENT.pack(self._maps.will.newest_sequence(), self.sent_ns))

    def leave(self, will: Will) -> None:
        """Write down what a successor needs, before the packet it tells of goes out.

        What is too long for its file is counted.
        """
        try:
            self._maps.will.write(self._writer.pack(will))
        except ValueError:
            self._counters["wills_too_long"] += 1

    def left(self) -> tuple[Will, int | None] | None:
        """What the guard before left, and when the packet of it had gone out at the latest [ns].

        The instant is None if it did not say that the packet went out. All is None if there was no
        guard before, or what it left cannot be read.
        """
        message, sent = self._maps.will.read(), self._maps.sent.read()
        if message is None:
            return None
        try:
            will = unpack_will(message[1])
        except ValueError:
            self._counters["wills_malformed"] += 1
            return None
        sequence, sent_ns = (0, 0) if sent is None else SENT.unpack(sent[1])
        return will, sent_ns if sequence == message[0] else None

    @property
    def has_predecessor(self) -> bool:
        """Whether another guard has left something, readable or not."""
        return self._maps.will.newest_sequence() > 0

    def leave_reason(self) -> str:
        """Why the service ends, by its own word; empty if somebody wished it."""
        message = self._maps.service.read()
        try:
            return "" if message is None else str(json.loads(message[1]).get("leaving", ""))[:200]
        except (ValueError, AttributeError):
            return ""

    def show(self, snapshot: bytes) -> None:
        """Publish the snapshot for the page; one that is too long is counted."""
        try:
            self._maps.guard.write(snapshot)
        except ValueError:
            self._counters["snapshots_too_long"] += 1


def open_link(descriptor: int) -> socket.socket:
    """The platform's socket, inherited from the supervisor."""
    link = socket.socket(fileno=os.dup(descriptor))
    link.setblocking(False)
    with contextlib.suppress(OSError):
        link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 16384)
    return link
