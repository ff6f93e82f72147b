"""How long a plan takes: algorithms and backends in lock-step over a shipped recording.

Run as ``python -m motionserver.evaluate.bench.plan CASE TICKS PACED``: a process of its own, so
that BLAS has one thread and nothing else is loaded; with the planner's scheduling. The clock of the
drive is a manual one: a late step changes no plan.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from motionserver.cueing.reference import MODELS
from motionserver.cueing.registry import algorithms
from motionserver.cueing.tuning import Tuning
from motionserver.evaluate.bench.plan_steps import KERNEL_SIZE, PERIOD, time_plans
from motionserver.evaluate.bench.processes import BenchError, Helper, say
from motionserver.evaluate.bench.quiet import quiet
from motionserver.evaluate.bench.report import Row, row_of_histogram, row_of_samples
from motionserver.evaluate.bench.sentinel import Sentinel
from motionserver.settings.machine import load_machine
from motionserver.solvers.registry import BACKENDS, present
from motionserver.telemetry.histogram import Histogram

PRIORITY: Final = 30
"""The planner's."""
DEFAULT: Final = f"{Tuning().algorithm} {'legs ' if Tuning().algorithm != 'mpc' else ''}daqp"
UNPACED_SHARE: Final = 0.25
"""Of the drive's length for which a sentinel sleeps beside periods that wait for nothing."""


@dataclass(frozen=True, slots=True)
class PlanBench:
    """What to measure.

    Attributes:
        ticks: Periods of the drive, per case.
        paced: Wait for each period to begin, as live; else as fast as it goes.
        only: Word that a case's name must contain.
    """

    ticks: int
    paced: bool = True
    only: str = ""


def backends() -> tuple[str, ...]:
    """Those whose library is there."""
    return tuple(name for name in BACKENDS if present(name))


def plan_cases() -> dict[str, Tuning]:
    """What is measured: every algorithm of ours on every backend that is there."""
    base = Tuning()
    cases: dict[str, Tuning] = {}
    if "mpc" in algorithms():
        cases = {
            f"mpc {backend}": replace(base, algorithm="mpc", backend=backend)
            for backend in backends()
        }
        cases |= {
            f"mpc {reference} daqp": replace(base, algorithm="mpc", reference=reference)
            for reference in MODELS
            # the learned model needs a file of one's own
            if reference not in (base.reference, "learned")
        }
    cases |= {
        f"thondel2014 {'legs' if legs else 'box'} {backend}": replace(
            base, algorithm="thondel2014", legs=legs, backend=backend
        )
        for legs in (True, False)
        for backend in backends()
    }
    return {**cases, "classical": replace(base, algorithm="classical")}


def measure_plan(name: str, ticks: int, paced: bool = True) -> dict[str, Any]:
    """One case in this process: its rows as mappings, its kernel's times, its scheduling."""
    # who never waits is stopped by the kernel for 50 ms of every second under SCHED_FIFO
    with quiet(PRIORITY if paced else 0) as scheduling:
        times = time_plans(load_machine("t2-compact"), plan_cases()[name], ticks, paced)
    rows = [row.to_mapping() for row in times.rows(name)]
    return {"rows": rows, "kernel": times.kernel, "scheduling": scheduling}


def bench_plan(what: PlanBench) -> list[Row]:
    """Measure plan times, each case in a process of its own beside a sentinel.

    Raises:
        BenchError: No case has such a name.
    """
    names = [name for name in plan_cases() if what.only in name]
    if not names:
        raise BenchError(
            f"bench plan: no case is called {what.only!r}; allowed is a part of one of: "
            + ", ".join(plan_cases())
        )
    rows: list[Row] = []
    kernels: list[int] = []
    asleep = Histogram()
    scheduling = ""
    beside = what.ticks * PERIOD * (1.0 if what.paced else UNPACED_SHARE)
    for name in names:
        arguments = (name, str(what.ticks), str(int(what.paced)))
        with (
            Helper("motionserver.evaluate.bench.plan", *arguments) as plans,
            Sentinel(PERIOD, beside, PRIORITY) as sentinel,
        ):
            found = plans.result()
            late = sentinel.late()
        rows += [Row(**row) for row in found["rows"]]
        rows.append(row_of_samples("  kernel beside it", found["kernel"]))
        rows.append(row_of_histogram("  sentinel beside it", late))
        kernels += found["kernel"]
        asleep, scheduling = asleep.plus(late), found["scheduling"]
    rows.append(row_of_samples(f"kernel: {KERNEL_SIZE} x {KERNEL_SIZE} product", kernels))
    rows.append(row_of_histogram("sentinel 100 Hz", asleep, scheduling=scheduling))
    return rows


def headline(rows: Sequence[Row]) -> str:
    """The one line that says whether the default fits; empty if it was not measured."""
    default = next((row for row in rows if row.name == DEFAULT), None)
    if default is None:
        return ""
    return f"default ({DEFAULT}): p99.9 {default.p999_ms:.2f} ms, half a period is 5 ms"


if __name__ == "__main__":
    say(measure_plan(sys.argv[1], int(sys.argv[2]), sys.argv[3] == "1"))
