"""Lateness of guard and planner in a real server, idle and under HTTP load."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack, suppress
from typing import Any, Final

from motionserver.evaluate.bench.processes import BenchError, Helper
from motionserver.evaluate.bench.report import Row, row_of_histogram
from motionserver.evaluate.bench.sentinel import Sentinel
from motionserver.evaluate.bench.server import BenchServer
from motionserver.telemetry.histogram import Histogram

RECORDING: Final = "truck_brake_accel"
RATES_HZ: Final = (60.0, 480.0)
"""The base's own rate, where the guard ticks four times as often, and the fastest one tried."""
CONNECTIONS: Final = 16
STREAMS: Final = 8
GUARD_PRIORITY: Final = 50
PLANNER_PRIORITY: Final = 30


def bench_loop(
    seconds: float,
    rates_hz: Sequence[float] = RATES_HZ,
    realtime: Sequence[bool] = (False, True),
) -> list[Row]:
    """Measure lateness: every rate, without and with SCHED_FIFO, idle and under load.

    Args:
        seconds: Length of each of the four stretches per rate [s].
        rates_hz: Packets per second of the platform.
        realtime: Whether the processes ask for SCHED_FIFO: without, with, or both in turn.

    Raises:
        BenchError: The server did not run.
    """
    rows: list[Row] = []
    for rate_hz in rates_hz:
        for asked in realtime:
            with BenchServer(rate_hz, asked) as server, server.replay(RECORDING):
                # ticks can be measured in any state; which it was stands beside them
                with suppress(BenchError):
                    server.engage()
                server.await_page()
                for loaded in (False, True):
                    rows += measure_stretch(server, seconds, loaded)
            rows[-1].notes["judge's violations"] = server.verdict["violations"]
    return rows


def measure_stretch(server: BenchServer, seconds: float, loaded: bool) -> list[Row]:
    """Lateness of guard and planner over one stretch of a running server, and of two sentinels.

    Args:
        server: It runs, and a cue comes.
        seconds: How long [s].
        loaded: Whether the page is asked as fast as it answers meanwhile.
    """
    tick_hz = server.guard()["rates_hz"]["tick"]
    plan_hz = server.plan_hz
    priorities = (GUARD_PRIORITY, PLANNER_PRIORITY) if server.realtime else (0, 0)
    kind = f"{'FIFO' if server.realtime else 'plain'} {'load' if loaded else 'idle'}"
    pressed: dict[str, Any] = {}
    with ExitStack() as stack:
        load = None
        if loaded:
            # it lasts longer than the sentinels, which take their time to start
            options = (str(server.web_port), str(seconds + 1.0), str(CONNECTIONS), str(STREAMS))
            load = stack.enter_context(Helper("motionserver.evaluate.bench.load", *options))
        beside_guard = stack.enter_context(Sentinel(1.0 / tick_hz, seconds, priorities[0]))
        beside_planner = stack.enter_context(Sentinel(1.0 / plan_hz, seconds, priorities[1]))
        before = server.guard(), server.planner()
        guard_sentinel = beside_guard.row(f"  sentinel {tick_hz:.0f} Hz {kind}")
        planner_sentinel = beside_planner.row(f"  sentinel {plan_hz:.0f} Hz {kind}")
        after = server.guard(), server.planner()
        if load is not None:
            pressed = {"HTTP requests/s": round(load.result()["requests_per_s"])}
    guard = _stretch(
        f"guard {tick_hz:.0f} Hz {kind}",
        before[0],
        after[0],
        guard_sentinel,
        {"scheduling": after[0]["tick"]["scheduling"], "state": after[0]["state"], **pressed},
    )
    planner = _stretch(
        f"planner {plan_hz:.0f} Hz {kind}", before[1], after[1], planner_sentinel, {}
    )
    return [guard, guard_sentinel, planner, planner_sentinel]


def _stretch(
    name: str,
    before: dict[str, Any],
    after: dict[str, Any],
    sentinel: Row,
    notes: dict[str, Any],
) -> Row:
    first, last = before["tick"], after["tick"]
    counted = histogram_between(before, after)
    if before["pid"] != after["pid"]:
        notes["restarted"], first = True, {"missed": 0}
    row = row_of_histogram(name, counted, missed=last["missed"] - first["missed"])
    row.notes["p99 / sentinel's"] = row.p99_ms / max(sentinel.p99_ms, 1e-3)
    row.notes.update(notes)
    return row


def histogram_between(before: dict[str, Any], after: dict[str, Any]) -> Histogram:
    """Lateness of the ticks between two snapshots; of all, if another process wrote the second."""
    counted = Histogram.from_mapping(after["tick"]["late_bins"])
    if before["pid"] != after["pid"]:
        return counted
    return counted.since(Histogram.from_mapping(before["tick"]["late_bins"]))
