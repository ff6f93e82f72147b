"""How long a plan takes: algorithms and backends in lock-step over a shipped recording.

Run as ``python -m motionserver.evaluate.bench.plan CASE SECONDS``: a process of its own, so that
BLAS has one thread and nothing else is loaded; with the planner's scheduling, and paced like it, so
that caches are as cold as live. The clock of the drive is a manual one: a late step changes no
plan.
"""

from __future__ import annotations

import gc
import sys
from dataclasses import replace
from typing import Any, Final

from motionserver.cueing.tuning import Tuning
from motionserver.evaluate.bench.plan_steps import KERNEL_SIZE, PERIOD, time_plans
from motionserver.evaluate.bench.processes import Helper, say
from motionserver.evaluate.bench.report import Row, row_of_histogram, row_of_samples
from motionserver.evaluate.bench.sentinel import Sentinel
from motionserver.settings.machine import load_machine
from motionserver.solvers.registry import BACKENDS
from motionserver.telemetry.histogram import Histogram
from motionserver.telemetry.realtime import take_priority

PRIORITY: Final = 30
"""The planner's."""
DEFAULT: Final = "thondel2014 legs daqp"


def plan_cases() -> dict[str, Tuning]:
    """What is measured: both algorithms, the MPC with and without leg rows on every backend."""
    base = Tuning()
    cases = {
        f"thondel2014 {'legs' if legs else 'box'} {backend}": replace(
            base, algorithm="thondel2014", legs=legs, backend=backend
        )
        for legs in (True, False)
        for backend in BACKENDS
    }
    return {**cases, "classical": replace(base, algorithm="classical")}


def measure_plan(name: str, seconds: float) -> dict[str, Any]:
    """One case in this process: its rows as mappings, its kernel's times, its scheduling."""
    scheduling = take_priority(PRIORITY, True)
    gc.collect()
    gc.freeze()
    gc.disable()
    times = time_plans(load_machine("t2-compact"), plan_cases()[name], seconds)
    rows = [row.to_mapping() for row in times.rows(name)]
    return {"rows": rows, "kernel": times.kernel, "scheduling": scheduling}


def bench_plan(seconds: float) -> list[Row]:
    """Measure plan times, each case in a process of its own beside a sentinel.

    Args:
        seconds: Of the drive, per case [s]; a case that cannot keep up takes longer.
    """
    rows: list[Row] = []
    kernels: list[int] = []
    asleep = Histogram()
    scheduling = ""
    for name in plan_cases():
        with (
            Helper("motionserver.evaluate.bench.plan", name, str(seconds)) as plans,
            Sentinel(PERIOD, seconds, PRIORITY) as sentinel,
        ):
            found = plans.result()
            late = sentinel.late()
        rows += [Row(**row) for row in found["rows"]]
        kernels += found["kernel"]
        asleep, scheduling = asleep.plus(late), found["scheduling"]
    rows.append(row_of_samples(f"kernel: {KERNEL_SIZE} x {KERNEL_SIZE} product", kernels))
    rows.append(row_of_histogram("sentinel 100 Hz", asleep, scheduling=scheduling))
    return rows


def headline(rows: list[Row]) -> str:
    """The one line that says whether the default fits."""
    default = next(row for row in rows if row.name == DEFAULT)
    return f"default with leg rows: p99.9 {default.p999_ms:.2f} ms, half a period is 5 ms"


if __name__ == "__main__":
    say(measure_plan(sys.argv[1], float(sys.argv[2])))
