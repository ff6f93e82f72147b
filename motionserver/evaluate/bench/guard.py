"""The guard at its fastest under load: every tick told apart from the stalls of the machine.

Each send of the guard leaves a row in the black box; where it ticks once per send, that is every
tick with its instant and lateness. Ticks that touch a stall seen by a core's own sentinel are
excluded and counted; a run that excludes more than `VOID` of them is void and repeated.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from motionserver.core.axes import Bools
from motionserver.evaluate.bench.loop import (
    CONNECTIONS,
    GUARD_PRIORITY,
    PLANNER_PRIORITY,
    RECORDING,
    STREAMS,
    histogram_between,
)
from motionserver.evaluate.bench.processes import BenchError, Helper
from motionserver.evaluate.bench.report import Row, row_of_histogram, row_of_samples
from motionserver.evaluate.bench.sentinel import Sentinel
from motionserver.evaluate.bench.server import BenchServer
from motionserver.evaluate.bench.stalls import Instants, StallWatch, overlapping
from motionserver.telemetry.blackbox.history import History
from motionserver.telemetry.blackbox.room import FOLDER

RATES_HZ: Final = (1000.0, 480.0)
VOID: Final = 0.02
"""Share of excluded ticks above which a run says nothing."""
TRIES: Final = 3
LONGEST: Final = 50.0
"""The black box keeps a minute [s]."""
_ROW: Final = struct.Struct("<Q3xQI")
"""Instant, state, order, whether sent, lateness, ticks: the beginning of a row."""


@dataclass(frozen=True, slots=True)
class Ticks:
    """Every tick of a stretch.

    Attributes:
        woken_ns: When each began, (N,) [ns].
        late_ns: How late, (N,) [ns].
        missed: Slots lost before each, (N,).
        stood: Whether the machine stood between the tick before and this one, (N,).
    """

    woken_ns: Instants
    late_ns: Instants
    missed: Instants
    stood: Bools

    @property
    def excluded(self) -> float:
        """Share of slots that are not judged, 0..1."""
        slots = 1 + self.missed
        return float(slots[self.stood].sum() / max(1, slots.sum()))

    def row(self, name: str, notes: dict[str, Any]) -> Row:
        """Lateness and lost slots of what is judged."""
        kept = ~self.stood
        missed, slots = int(self.missed[kept].sum()), int((1 + self.missed[kept]).sum())
        told = {
            "missed": f"{missed} of {slots} ({missed / max(1, slots):.2%})",
            "excluded": f"{self.excluded:.2%}",
            "missed with them": int(self.missed.sum()),
        }
        return row_of_samples(name, self.late_ns[kept].tolist(), **told, **notes)


def ticks_of(rows: Instants, period_ns: float, stalls: Instants) -> Ticks:
    """Judge rows (N, 2) of instants and lateness [ns] against stalls (M, 2) [ns]."""
    woken, late = rows[1:, 0], rows[1:, 1]
    return Ticks(woken, late, late // int(period_ns), overlapping(rows[:-1, 0], woken, stalls))


def bench_guard(
    seconds: float,
    rates_hz: Sequence[float] = RATES_HZ,
    realtime: Sequence[bool] = (False, True),
) -> list[Row]:
    """Measure lateness and lost slots under HTTP load, without and with SCHED_FIFO.

    Args:
        seconds: Length of each stretch, at most `LONGEST` [s].
        rates_hz: Packets per second of the platform, 240 or more: the guard ticks once for each.
        realtime: Whether the processes ask for SCHED_FIFO.

    Raises:
        BenchError: The server did not run, or left no rows.
    """
    rows: list[Row] = []
    for rate_hz in rates_hz:
        for asked in realtime:
            with BenchServer(rate_hz, asked) as server, server.replay(RECORDING):
                # ticks can be measured in any state; which it was stands beside them
                with suppress(BenchError):
                    server.engage()
                server.await_page()
                for attempt in range(1, TRIES + 1):
                    found, excluded = _stretch(server, min(seconds, LONGEST), attempt)
                    if excluded <= VOID:
                        break
            found[0].notes["judge's violations"] = server.verdict["violations"]
            if excluded > VOID:
                found[0].notes["void"] = f"the machine stood in more than {VOID:.0%} of the ticks"
            rows += found
    return rows


def _stretch(server: BenchServer, seconds: float, attempt: int) -> tuple[list[Row], float]:
    tick_hz, kind = server.rate_hz, "FIFO" if server.realtime else "plain"
    priorities = (GUARD_PRIORITY, PLANNER_PRIORITY) if server.realtime else (0, 0)
    with ExitStack() as stack:
        # load and watchers last longer than the sentinels, which take their time to start
        options = (str(server.web_port), str(seconds + 2.0), str(CONNECTIONS), str(STREAMS))
        load = stack.enter_context(Helper("motionserver.evaluate.bench.load", *options))
        watch = stack.enter_context(StallWatch(seconds + 1.0))
        beside_guard = stack.enter_context(Sentinel(1.0 / tick_hz, seconds, priorities[0]))
        beside_planner = stack.enter_context(Sentinel(1.0 / server.plan_hz, seconds, priorities[1]))
        before = server.guard(), server.planner()
        guard_sentinel = beside_guard.row(f"  sentinel {tick_hz:.0f} Hz {kind}")
        planner_sentinel = beside_planner.row(f"  sentinel {server.plan_hz:.0f} Hz {kind}")
        after = server.guard(), server.planner()
        rows = _rows(server, before[0]["t_ns"], after[0]["t_ns"])
        stalls, cores = watch.result()
        pressed = load.result()
    ticks = ticks_of(rows, 1e9 / tick_hz, stalls)
    accepted = _counted(before[0], after[0], "plans_accepted")
    notes = {
        "HTTP requests/s": round(pressed["requests_per_s"]),
        "streams' events/s": round(pressed["events_per_s"]),
        "plans accepted": accepted,
        "rejected": _counted(before[0], after[0], "plans_rejected"),
        "state": after[0]["state"],
        "scheduling": after[0]["tick"]["scheduling"],
    }
    if attempt > 1:
        notes["attempt"] = attempt
    planner = row_of_histogram(
        f"planner {server.plan_hz:.0f} Hz {kind} load",
        histogram_between(before[1], after[1]),
        missed=after[1]["tick"]["missed"] - before[1]["tick"]["missed"],
    )
    guard = ticks.row(f"guard {tick_hz:.0f} Hz {kind} load", notes)
    return [guard, guard_sentinel, *cores, planner, planner_sentinel], ticks.excluded


def _counted(before: dict[str, Any], after: dict[str, Any], name: str) -> int:
    return int(after["counters"].get(name, 0) - before["counters"].get(name, 0))


def _rows(server: BenchServer, begin_ns: int, end_ns: int) -> Instants:
    """Instants and lateness of every tick between two instants, (N, 2) [ns]."""
    try:
        history = History(server.run_dir / FOLDER / "guard.history")
    except (OSError, ValueError) as error:
        raise BenchError(f"bench guard: no black box to read ({error})") from error
    kept = [_ROW.unpack_from(data)[:2] for _, data in history.since()]
    history.close()
    rows = np.array(kept, dtype=np.int64).reshape(-1, 2)
    rows = rows[(rows[:, 0] > begin_ns) & (rows[:, 0] <= end_ns)]
    if len(rows) < 2:
        raise BenchError("bench guard: the black box holds no tick of this stretch")
    return rows
