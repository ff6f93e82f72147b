"""Strangers flood the ports of guard and planner while a client that signs goes on sending."""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from threading import Event
from time import sleep
from typing import Any, Final

from motionserver.evaluate.bench.latency import punctual
from motionserver.evaluate.bench.loop import GUARD_PRIORITY, histogram_between
from motionserver.evaluate.bench.processes import BenchError, Helper
from motionserver.evaluate.bench.report import Row, row_of_histogram
from motionserver.evaluate.bench.sentinel import Sentinel
from motionserver.evaluate.bench.server import BenchServer
from motionserver.evaluate.bench.step_sender import StepSender

FLOOD_HZ: Final = 100_000.0
"""Datagrams of strangers per second."""
RATE_HZ: Final = 60.0
"""Of the platform: the guard ticks at 240 Hz."""
_ARRIVAL: Final = 0.3
"""Wait after the flood, so that the last snapshot holds all of it [s]."""


def bench_flood(seconds: float, realtime: bool = True) -> list[Row]:
    """Measure the guard's lateness and the client's losses: idle, then each port flooded.

    Args:
        seconds: Length of each of the three stretches [s].
        realtime: Whether the processes ask for SCHED_FIFO.

    Raises:
        BenchError: The server did not run.
    """
    key = os.urandom(32)
    rows: list[Row] = []
    with BenchServer(RATE_HZ, realtime, key) as server:
        sender = StepSender(server.cue_port, key=key)
        with _sending(sender):
            server.engage()
            for name, port in (
                ("idle", 0),
                ("cue port flooded", server.cue_port),
                ("platform port flooded", server.platform_port),
            ):
                rows += _stretch(server, sender, seconds, name, port)
        sender.close()
    rows[0].notes["judge's violations"] = server.verdict["violations"]
    for row in rows[2::2]:
        row.notes["p99 - idle p99"] = f"{row.p99_ms - rows[0].p99_ms:+.3f} ms"
    return rows


@contextmanager
def _sending(sender: StepSender) -> Iterator[None]:
    """The client is never silent, whatever is started or waited for meanwhile."""
    ended = Event()

    def go_on() -> None:
        with punctual():
            while not ended.is_set():
                sender.hold(0.1)

    with ThreadPoolExecutor(1) as aside:
        going = aside.submit(go_on)
        try:
            yield
        finally:
            ended.set()
        going.result()


def _stretch(
    server: BenchServer, sender: StepSender, seconds: float, name: str, port: int
) -> list[Row]:
    tick_hz = server.guard()["rates_hz"]["tick"]
    with ExitStack() as stack:
        beside = stack.enter_context(
            Sentinel(1.0 / tick_hz, seconds, GUARD_PRIORITY if server.realtime else 0)
        )
        strangers = None
        before = server.guard(), server.planner()
        if port:
            words = (str(port), str(FLOOD_HZ), str(seconds))
            strangers = stack.enter_context(Helper("motionserver.evaluate.bench.flooder", *words))
        sleep(seconds)
        during = server.planner()["source"]
        flooded = {} if strangers is None else strangers.result()
        sleep(_ARRIVAL)
        after = server.guard(), server.planner()
        sentinel = beside.row(f"  sentinel {tick_hz:.0f} Hz")
    if before[1]["pid"] != after[1]["pid"] or before[0]["pid"] != after[0]["pid"]:
        raise BenchError("bench flood: a process was started again meanwhile")
    notes: dict[str, Any] = {"missed": after[0]["tick"]["missed"] - before[0]["tick"]["missed"]}
    if flooded:
        notes["strangers' packets/s"] = round(flooded["per_s"])
        notes["dropped in the kernel"] = _more(before[1], after[1], "dropped_by_kernel") + _more(
            before[0], after[0], "feedback_foreign"
        )
        notes["filter"] = next(iter(during["filters"].values()), "none")
    # what a snapshot counts was sent before it; one packet at either end may be under way
    begin, end = before[1]["t_ns"], after[1]["t_ns"]
    sent = sum(begin < at <= end for at in sender.sent_ns)
    lost = max(0, sent - _more(before[1], after[1], "accepted"))
    notes["client lost"] = f"{lost} of {sent} ({lost / max(1, sent):.2%})"
    notes["state"] = after[0]["state"]
    notes["scheduling"] = after[0]["tick"]["scheduling"]
    counted = histogram_between(before[0], after[0])
    return [row_of_histogram(f"guard {tick_hz:.0f} Hz, {name}", counted, **notes), sentinel]


def _more(before: dict[str, Any], after: dict[str, Any], name: str) -> int:
    return int(after["counters"].get(name, 0) - before["counters"].get(name, 0))
