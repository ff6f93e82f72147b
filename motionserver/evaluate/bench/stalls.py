"""When the machine itself stood: a process on each core that only sleeps, above everything else.

What is late while such a process is late as well, no program could have done in time. Run as
``python -m motionserver.evaluate.bench.stalls PERIOD_NS SECONDS PRIORITY CORE``.
"""

from __future__ import annotations

import contextlib
import os
import sys
import time
from contextlib import ExitStack
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from motionserver.core.axes import Bools
from motionserver.evaluate.bench.processes import Helper, say
from motionserver.evaluate.bench.quiet import quiet
from motionserver.evaluate.bench.report import Row, row_of_histogram
from motionserver.telemetry.histogram import Histogram

Instants = NDArray[np.int64]

STALL_NS: Final = 1_000_000
"""A core that was away for longer stood [ns]."""
PERIOD_NS: Final = 1_000_000
PRIORITY: Final = 95


class StallWatch:
    """Watches every core for some seconds; use it as a context, then ask.

    Args:
        seconds: How long [s].
    """

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._stack = ExitStack()
        self._watchers: list[Helper] = []

    def __enter__(self) -> Self:
        """Start one watcher per core and wait until all are ready."""
        with ExitStack() as stack:
            for core in sorted(os.sched_getaffinity(0)):
                words = (str(PERIOD_NS), str(self._seconds), str(PRIORITY), str(core))
                watcher = Helper("motionserver.evaluate.bench.stalls", *words, asks=True)
                self._watchers.append(stack.enter_context(watcher))
            for watcher in self._watchers:
                watcher.line()
            for watcher in self._watchers:
                watcher.tell("go")
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        """End them."""
        self._stack.close()

    def result(self) -> tuple[Instants, list[Row]]:
        """Stalls as (from, to), (N, 2) [ns], by their beginning; and a row for each core."""
        found: list[Any] = [watcher.result() for watcher in self._watchers]
        stalls = sorted(tuple(pair) for one in found for pair in one["stalls"])
        rows = [
            row_of_histogram(
                f"  core {one['core']} alone",
                Histogram.from_mapping(one["late_bins"]),
                stalls=len(one["stalls"]),
                scheduling=one["scheduling"],
            )
            for one in found
        ]
        return np.array(stalls, dtype=np.int64).reshape(-1, 2), rows


def overlapping(begin: Instants, end: Instants, stalls: Instants) -> Bools:
    """Which of the spans (N,), (N,) [ns] touch a stall (M, 2) [ns]."""
    out: Bools = np.zeros(len(begin), dtype=bool)
    for first, last in stalls:
        out |= (begin <= last) & (end >= first)
    return out


def watch(period_ns: int, seconds: float) -> dict[str, object]:
    """Sleep on a grid; note how late, and each time it stood."""
    late, stalls = Histogram(), []
    due = start = time.monotonic_ns()
    while due - start < seconds * 1e9:
        due += period_ns
        time.sleep(max(0.0, (due - time.monotonic_ns()) * 1e-9))
        now = time.monotonic_ns()
        late.add(now - due)
        if now - due > STALL_NS:
            stalls.append((due, now))
            due = now - (now - due) % period_ns
    return {"late_bins": late.to_mapping(), "stalls": stalls}


def main(arguments: list[str]) -> int:
    """Watch one core, and tell."""
    period_ns, seconds = int(arguments[0]), float(arguments[1])
    priority, core = int(arguments[2]), int(arguments[3])
    with contextlib.suppress(OSError):
        os.sched_setaffinity(0, {core})
    say("ready")
    sys.stdin.readline()
    with quiet(priority) as scheduling:
        seen = watch(period_ns, seconds)
    say({**seen, "core": core, "scheduling": scheduling})
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
