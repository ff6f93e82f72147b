"""The sentinel: a process that only sleeps on the guard's grid, so that blame can be told apart.

Whatever it is late, the machine was late: no tick beside it can be more punctual than it is.
Run as ``python -m motionserver.evaluate.bench.sentinel PERIOD_NS SECONDS PRIORITY``.
"""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Mapping
from typing import Self

from motionserver.evaluate.bench.processes import Helper, say
from motionserver.evaluate.bench.quiet import quiet
from motionserver.evaluate.bench.report import Row, row_of_histogram
from motionserver.telemetry.histogram import Histogram
from motionserver.telemetry.ticker import Lateness, Ticker, now_ns


class Sentinel(Helper):
    """One sentinel process; `row` waits for its end.

    Args:
        period: Of its grid [s].
        seconds: How long it sleeps [s].
        priority: For SCHED_FIFO, as the process beside it asks for; 0 for none.
        waits: True: it begins at `go`, not when it is entered.
    """

    def __init__(self, period: float, seconds: float, priority: int, waits: bool = False) -> None:
        arguments = (str(round(period * 1e9)), str(seconds), str(priority))
        super().__init__("motionserver.evaluate.bench.sentinel", *arguments, asks=True)
        self._waits = waits

    def __enter__(self) -> Self:
        """Wait until it is ready, and let it sleep unless it shall wait."""
        self.line()
        if not self._waits:
            self.go()
        return self

    def go(self) -> None:
        """Let it begin."""
        self.tell("go")

    def late(self) -> Histogram:
        """Wait for its end and read how late it was."""
        return Histogram.from_mapping(self.result()["late_bins"])

    def row(self, name: str) -> Row:
        """Wait for its end and read all it saw."""
        seen = self.result()
        counted = Histogram.from_mapping(seen["late_bins"])
        return row_of_histogram(name, counted, missed=seen["missed"], scheduling=seen["scheduling"])


async def sleep_on_grid(period_ns: int, seconds: float) -> Mapping[str, object]:
    """Tick and do nothing.

    Args:
        period_ns: Of the grid [ns].
        seconds: How long [s].

    Returns:
        The summary of its lateness.
    """
    lateness = Lateness(period_ns)
    done = asyncio.get_running_loop().create_future()
    start_ns = now_ns()
    slot = 0

    def wake() -> None:
        nonlocal slot
        now = now_ns()
        lateness.ticked(now - start_ns - (slot + 1) * period_ns)
        slot = (now - start_ns) // period_ns
        if now - start_ns < seconds * 1e9:
            ticker.arm(start_ns + (slot + 1) * period_ns)
        elif not done.done():
            done.set_result(None)

    ticker = Ticker(wake)
    ticker.arm(start_ns + period_ns)
    await done
    ticker.close()
    return lateness.summary()


def main(arguments: list[str]) -> int:
    """Sleep, and tell."""
    period_ns, seconds, priority = int(arguments[0]), float(arguments[1]), int(arguments[2])
    say("ready")
    sys.stdin.readline()
    with quiet(priority) as scheduling:
        late = asyncio.run(sleep_on_grid(period_ns, seconds))
    say({**late, "scheduling": scheduling})
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
