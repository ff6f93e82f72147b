"""The command ``bench``: measure, print, keep."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from motionserver.errors import ConfigError
from motionserver.evaluate.bench.flood import bench_flood
from motionserver.evaluate.bench.guard import bench_guard
from motionserver.evaluate.bench.latency import bench_latency
from motionserver.evaluate.bench.loop import bench_loop
from motionserver.evaluate.bench.plan import PlanBench, backends, bench_plan, headline
from motionserver.evaluate.bench.plan_accuracy import accuracy_text, bench_accuracy
from motionserver.evaluate.bench.plan_growth import bench_growth, growth_text
from motionserver.evaluate.bench.plan_steps import PERIOD
from motionserver.evaluate.bench.report import Row, describe_machine, machine_text, table_text
from motionserver.evaluate.files import check_file

WHATS: Final = ("loop", "guard", "flood", "plan", "latency")
_MOST: Final = 3600.0
"""Longest stretch [s]."""


def run_bench(
    what: str,
    seconds: float,
    json_out: Path | None,
    ticks: int | None = None,
    paced: bool = True,
    only: str = "",
) -> int:
    """Measure and print; every figure stands beside a sentinel of the same run.

    Args:
        what: One of `WHATS`, or "all".
        seconds: Length of each stretch [s].
        json_out: File for all figures.
        ticks: Periods per case of "plan" instead of ``seconds``.
        paced: Whether those wait for their time, as live.
        only: Word that a case's name of "plan" must contain; growth and accuracy are of "mpc".

    Returns:
        Exit status, 0: figures are told, not judged.

    Raises:
        BenchError: A benchmark could not be carried out.
        ConfigError: An argument is wrong.
    """
    if what not in (*WHATS, "all"):
        raise ConfigError("bench", f"unknown {what!r}", f"Allowed: {', '.join(WHATS)}, all.")
    if not PERIOD <= seconds <= _MOST:
        raise ConfigError(
            "--seconds", f"{seconds:g} s is out of range", f"Give {PERIOD:g} to {_MOST:g} s."
        )
    count = round(seconds / PERIOD) if ticks is None else ticks
    most = round(_MOST / PERIOD)
    if not 0 < count <= most:
        raise ConfigError("--ticks", f"{count} is out of range", f"Give 1 to {most}.")
    check_file("--json", json_out)
    machine = describe_machine()
    _tell(machine_text(machine))
    out: dict[str, Any] = {"machine": machine, "seconds": seconds}
    measures: dict[str, Callable[[], list[Row]]] = {
        "loop": lambda: bench_loop(seconds),
        "guard": lambda: bench_guard(seconds),
        "flood": lambda: bench_flood(seconds),
        "plan": lambda: bench_plan(PlanBench(count, paced, only)),
        "latency": lambda: bench_latency(seconds),
    }
    titles = {
        "loop": "lateness of ticks",
        "guard": "lateness of every tick under load",
        "flood": "lateness of ticks in a flood",
        "plan": "plan times",
        "latency": "latency",
    }
    for name in WHATS if what == "all" else (what,):
        rows = measures[name]()
        _tell("", table_text(titles[name], rows))
        out[name] = [row.to_mapping() for row in rows]
        if name == "plan":
            _tell(*filter(None, [headline(rows)]))
            out |= {"ticks": count, "paced": paced}
    if what in ("plan", "all") and only in "mpc":
        out["plan_growth"] = bench_growth(count, backends())
        _tell("", growth_text(out["plan_growth"]))
        out["plan_accuracy"] = bench_accuracy(count, backends())
        _tell("", accuracy_text(out["plan_accuracy"]))
    if json_out is not None:
        json_out.write_text(json.dumps(out, indent=2) + "\n", encoding="utf-8")
    return 0


def _tell(*lines: str) -> None:
    sys.stdout.write("\n".join(lines) + "\n")
    sys.stdout.flush()
