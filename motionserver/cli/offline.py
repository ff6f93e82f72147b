"""evaluate, reproduce, bench."""

from __future__ import annotations

import sys
from pathlib import Path

from motionserver.errors import ConfigError
from motionserver.evaluate.command import evaluate
from motionserver.evaluate.report import to_text
from motionserver.settings.machine import load_machine

PAPERS = ("thondel2014",)
BENCHES = ("loop", "plan", "latency", "all")


def run_evaluate(
    recording: Path,
    algorithm: str,
    platform: str,
    scale: float,
    rate: float,
    setpoints: Path | None,
    json_out: Path | None,
    html_out: Path | None,
) -> int:
    """Evaluate and print; 1 if any limit was broken."""
    result = evaluate(
        recording,
        [name.strip() for name in algorithm.split(",") if name.strip()],
        load_machine(platform),
        scale=scale,
        rate=rate,
        setpoints=setpoints,
        json_out=json_out,
        html_out=html_out,
    )
    sys.stdout.write(to_text(result) + "\n")
    return 0 if result.violations == 0 else 1


def run_reproduce(paper: str, out: Path) -> int:
    """Redraw a paper; 1 if a claim no longer holds."""
    if paper not in PAPERS:
        raise ConfigError("PAPER", f"unknown {paper!r}", f"Allowed: {', '.join(PAPERS)}.")
    from motionserver.evaluate.reproduce.command import reproduce

    return reproduce(paper, out)


def run_bench(
    what: str,
    seconds: float,
    json_out: Path | None,
    ticks: int | None = None,
    paced: bool = True,
    only: str = "",
) -> int:
    """Measure and print."""
    if what not in BENCHES:
        raise ConfigError("bench", f"unknown {what!r}", f"Allowed: {', '.join(BENCHES)}.")
    from motionserver.evaluate.bench.command import run_bench as measure

    return measure(what, seconds, json_out, ticks, paced, only)
