"""The command ``bench``: measure, print, keep."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from motionserver.evaluate.bench.latency import bench_latency
from motionserver.evaluate.bench.loop import bench_loop
from motionserver.evaluate.bench.plan import bench_plan, headline
from motionserver.evaluate.bench.report import describe_machine, machine_text, table_text

_TITLES = {"loop": "lateness of ticks", "plan": "plan times", "latency": "latency"}
_MEASURES = {"loop": bench_loop, "plan": bench_plan, "latency": bench_latency}


def run_bench(what: str, seconds: float, json_out: Path | None) -> int:
    """Measure and print; every figure stands beside a sentinel of the same run.

    Args:
        what: "loop", "plan", "latency" or "all".
        seconds: Length of each stretch [s].
        json_out: File for all figures.

    Returns:
        Exit status, 0: figures are told, not judged.

    Raises:
        BenchError: A benchmark could not be carried out.
        ValueError: ``what`` is none of these, or ``seconds`` is not positive.
    """
    if what not in (*_MEASURES, "all") or not 0.0 < seconds <= 3600.0:
        raise ValueError(
            f"bench: {what!r} for {seconds:g} s is not possible; "
            f"allowed are {', '.join(_MEASURES)} or all, for up to 3600 s"
        )
    machine = describe_machine()
    _tell(machine_text(machine))
    out: dict[str, Any] = {"machine": machine, "seconds": seconds}
    for name, measure in _MEASURES.items():
        if what not in (name, "all"):
            continue
        rows = measure(seconds)
        _tell("", table_text(_TITLES[name], rows))
        out[name] = [row.to_mapping() for row in rows]
        if name == "plan":
            _tell(headline(rows))
    if json_out is not None:
        json_out.write_text(json.dumps(out, indent=2) + "\n", encoding="utf-8")
    return 0


def _tell(*lines: str) -> None:
    sys.stdout.write("\n".join(lines) + "\n")
    sys.stdout.flush()
