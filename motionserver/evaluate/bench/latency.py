"""From a packet of the simulator to the first set-point that it changed, on real sockets.

Steps of the vehicle's acceleration are sent at random phases; the base logs when each set-point
arrives. Beside it the same packets straight to such a base: what loopback and logging alone take.
"""

from __future__ import annotations

import contextlib
import os
import socket
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Final

import numpy as np
from motion_clients.moog_wire import COMMAND_SIZE, Mcw, decode_command
from motion_clients.motion_log import read_motion_log

from motionserver.core.axes import Array
from motionserver.evaluate.bench.processes import BenchError, Helper, free_port
from motionserver.evaluate.bench.report import Row, row_of_samples
from motionserver.evaluate.bench.sentinel import Sentinel
from motionserver.evaluate.bench.server import OTHERS_PRIORITY, BenchServer
from motionserver.evaluate.bench.step_sender import StepSender

PATIENCE: Final = 0.2
"""A step that shows later than this is counted as unseen [s]."""
_BEFORE: Final = 8
"""Set-points before a step that tell how uneven the motion is anyway."""
_FLOOR: Final = 2e-6
"""Least kink of a leg that is one, above the rounding of the words [m]."""
_ABOVE: Final = 2.0
_SETTLE: Final = 2.0
"""Cues before the first step [s]."""


def first_changes(arrivals_ns: Array, legs: Array, steps_ns: Sequence[int]) -> list[int | None]:
    """Find for each step the first set-point that it changed.

    A set-point is changed if its legs leave the parabola through the three before it by more than
    twice what any of the eight before the step did: the platform may well be moving.

    Args:
        arrivals_ns: When each set-point arrived, (N,) [ns].
        legs: Their words, (N, 6) [m].
        steps_ns: When each step was sent [ns].

    Returns:
        Rows of the set-points; None where none stands out in time.
    """
    kinks = np.zeros(len(legs))
    kinks[3:] = np.abs(np.diff(legs, 3, axis=0)).max(axis=1)
    found: list[int | None] = []
    for step in steps_ns:
        first = int(np.searchsorted(arrivals_ns, step))
        last = int(np.searchsorted(arrivals_ns, step + int(PATIENCE * 1e9)))
        quiet = kinks[max(3, first - _BEFORE) : first]
        if len(quiet) < _BEFORE:
            found.append(None)
            continue
        above = np.flatnonzero(kinks[first:last] > max(_FLOOR, _ABOVE * float(quiet.max())))
        found.append(first + int(above[0]) if len(above) else None)
    return found


def ages(arrivals_ns: Array, sent_ns: Array, transit_ns: int) -> Array:
    """Age of the newest cue in each set-point, if a cue needs at least ``transit_ns`` [ns]."""
    newest = np.searchsorted(sent_ns, arrivals_ns - transit_ns, side="right") - 1
    known = newest >= 0
    out: Array = (arrivals_ns[known] - sent_ns[newest[known]]).astype(np.float64)
    return out


def bench_latency(seconds: float, rate_hz: float = 60.0) -> list[Row]:
    """Measure packet to wire, the age of the cue on the wire, and the loopback's floor.

    Args:
        seconds: How long steps are sent; two to three a second [s].
        rate_hz: Packets per second of the platform [Hz].

    Raises:
        BenchError: The server did not run, or no step was seen.
    """
    with (
        BenchServer(rate_hz, realtime=True) as server,
        Sentinel(1.0 / rate_hz, seconds, 50, waits=True) as beside,
        ThreadPoolExecutor(1) as aside,
        punctual(),
    ):
        sender = StepSender(server.cue_port)
        engaging = aside.submit(server.engage)
        while not engaging.done():
            sender.hold(0.1)
        engaging.result()
        sender.hold(_SETTLE)
        beside.go()
        sender.drive(seconds)
        sender.hold(PATIENCE)
        state = server.guard()["state"]
        scheduling = server.guard()["tick"]["scheduling"]
        sender.close()
        sentinel = beside.row(f"  sentinel {rate_hz:.0f} Hz FIFO")
        server.stop()
        arrivals_ns, legs = _read(server.base_log)
    changes = first_changes(arrivals_ns, legs, sender.steps_ns)
    delays = [
        int(arrivals_ns[row]) - step
        for row, step in zip(changes, sender.steps_ns, strict=True)
        if row is not None
    ]
    if not delays:
        raise BenchError(
            f"bench latency: none of {len(changes)} steps was seen on the wire; the platform "
            f"ended in {state}, it must run"
        )
    sent_ns = np.asarray(sender.sent_ns)
    during = arrivals_ns[(arrivals_ns > sender.steps_ns[0]) & (arrivals_ns < sent_ns[-1])]
    unseen = sum(row is None for row in changes)
    return [
        row_of_samples(
            f"packet to wire {rate_hz:.0f} Hz",
            delays,
            unseen=f"{unseen} of {len(changes)}",
            state=state,
            scheduling=scheduling,
        ),
        row_of_samples("age of the cue on the wire", ages(during, sent_ns, min(delays))),
        loopback_floor(min(seconds, 5.0)),
        sentinel,
    ]


def loopback_floor(seconds: float) -> Row:
    """The same packets straight to a process like the base: loopback, waking and logging."""
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        log, port = Path(folder) / "floor.log", free_port(socket.SOCK_DGRAM)
        helper = Helper(
            "motionserver.evaluate.bench.base", str(port), "60", str(log), fifo=OTHERS_PRIORITY
        )
        with helper as base:
            base.line()
            sender = StepSender(port)
            with punctual():
                sender.drive(seconds)
            sender.close()
            base.process.terminate()
            base.result()
        delays = [
            arrival - sender.by_bytes[data]
            for arrival, data in read_motion_log(log)
            if data in sender.by_bytes
        ]
    return row_of_samples("UDP on loopback alone", delays)


@contextlib.contextmanager
def punctual() -> Iterator[None]:
    """The simulator has a computer of its own: this thread gets SCHED_FIFO, if permitted."""
    with contextlib.suppress(OSError):
        os.sched_setscheduler(
            0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(OTHERS_PRIORITY)
        )
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def _read(log: Path) -> tuple[Array, Array]:
    """Instants (N,) [ns] and legs (N, 6) [m] of the set-points that the base was sent."""
    arrivals: list[int] = []
    legs: list[tuple[float, ...]] = []
    for arrival, data in read_motion_log(log):
        if len(data) == COMMAND_SIZE and (command := decode_command(data)).mcw == Mcw.NEW_POSITION:
            arrivals.append(arrival)
            legs.append(command.words)
    return np.asarray(arrivals, dtype=np.int64), np.asarray(legs, dtype=np.float64)
