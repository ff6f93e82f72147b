"""Rows of percentiles, the machine they were measured on, and both as text."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from motionserver.core.axes import Array
from motionserver.telemetry.histogram import Histogram

SHARES: Final = {"p50": 0.5, "p90": 0.9, "p99": 0.99, "p999": 0.999}
_POLICIES: Final = {0: "SCHED_OTHER", 1: "SCHED_FIFO", 2: "SCHED_RR", 3: "SCHED_BATCH"}


@dataclass(frozen=True, slots=True)
class Row:
    """Percentiles of one quantity.

    Attributes:
        name: What was measured, and under what.
        count: How many values there are.
        p50_ms: Median [ms].
        p90_ms: [ms].
        p99_ms: [ms].
        p999_ms: [ms]; not better than the largest value when there are fewer than 1000.
        max_ms: Largest value [ms].
        notes: Anything else worth reading beside them.
    """

    name: str
    count: int
    p50_ms: float
    p90_ms: float
    p99_ms: float
    p999_ms: float
    max_ms: float
    notes: dict[str, Any] = field(default_factory=dict)

    def to_mapping(self) -> dict[str, Any]:
        """Write it for JSON."""
        return asdict(self)


def row_of_samples(name: str, samples_ns: Sequence[int] | Array, **notes: object) -> Row:
    """Percentiles of durations [ns]: values that occurred, none made up between two."""
    values = np.asarray(samples_ns, dtype=np.float64) / 1e6
    if len(values) == 0:
        return Row(name, 0, 0.0, 0.0, 0.0, 0.0, 0.0, dict(notes))
    cuts = np.quantile(values, list(SHARES.values()), method="inverted_cdf")
    p50, p90, p99, p999 = (round(float(cut), 4) for cut in cuts)
    return Row(name, len(values), p50, p90, p99, p999, round(float(values.max()), 4), dict(notes))


def row_of_histogram(name: str, counted: Histogram, **notes: object) -> Row:
    """Percentiles of a histogram of durations, right to some 3 %."""
    cuts = [counted.percentile(share) / 1e6 for share in (*SHARES.values(), 1.0)]
    p50, p90, p99, p999, largest = (round(cut, 4) for cut in cuts)
    return Row(name, counted.total, p50, p90, p99, p999, largest, dict(notes))


def describe_machine() -> dict[str, Any]:
    """What these figures were measured on."""
    model = ""
    for line in Path("/proc/cpuinfo").read_text("utf-8").splitlines():
        if line.startswith("model name"):
            model = line.partition(":")[2].strip()
            break
    return {
        "cpu": model or platform.processor() or platform.machine(),
        "cores": len(os.sched_getaffinity(0)),
        "kernel": platform.release(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scheduling": _POLICIES.get(os.sched_getscheduler(0), "other"),
        "load_average": os.getloadavg()[0],
    }


def machine_text(machine: Mapping[str, Any]) -> str:
    """The machine in one line."""
    return (
        f"{machine['cpu']}, {machine['cores']} cores, Linux {machine['kernel']}, "
        f"Python {machine['python']}, numpy {machine['numpy']}, started as "
        f"{machine['scheduling']}, load average {machine['load_average']:.1f}"
    )


def table_text(title: str, rows: Sequence[Row]) -> str:
    """A table for people: one row a line, notes at its end."""
    width = max([len(row.name) for row in rows] + [len(title)])
    head = "".join(f"{name:>9}" for name in ("p50", "p90", "p99", "p99.9", "max"))
    lines = [f"{title:<{width}} {'count':>7}{head}  [ms]"]
    for row in rows:
        cuts = (row.p50_ms, row.p90_ms, row.p99_ms, row.p999_ms, row.max_ms)
        figures = "".join(f"{cut:9.3f}" for cut in cuts)
        notes = ", ".join(f"{key} {_short(value)}" for key, value in row.notes.items())
        lines.append(f"{row.name:<{width}} {row.count:>7}{figures}  {notes}".rstrip())
    return "\n".join(lines)


def _short(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)
