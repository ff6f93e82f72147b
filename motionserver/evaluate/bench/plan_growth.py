"""How the time of a plan grows with its pieces: one power law per backend.

Run as ``python -m motionserver.evaluate.bench.plan_growth BACKEND TICKS``.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Final

import numpy as np

from motionserver.core.limits import Machine
from motionserver.cueing.base import Cueing
from motionserver.cueing.mpc import SixAxis
from motionserver.cueing.tuning import Tuning
from motionserver.evaluate.bench.plan_steps import LIVELY, time_plans
from motionserver.evaluate.bench.processes import Helper, say
from motionserver.evaluate.bench.quiet import quiet
from motionserver.settings.machine import load_machine

PIECES: Final = (10, 13, 15, 20, 25)
MOST_TICKS: Final = 400
"""Enough for a median; a power law needs no tail."""
SOLVE: Final = "solve"


@dataclass(frozen=True, slots=True)
class Growth:
    """Medians over the number of pieces, and t = c pieces^exponent fitted to them.

    Attributes:
        backend: QP backend.
        pieces: Numbers of pieces.
        propose_ms: Median time of the algorithm, one each [ms].
        solve_ms: Median time of the solver alone [ms]; empty where it is not told.
        kernels: The same of the algorithm in multiples of the kernel of the same run.
        exponent: Of ``kernels``: a machine that slows down meanwhile makes no growth.
        solve_exponent: Of the solver alone; None where it is not told.
    """

    backend: str
    pieces: tuple[int, ...]
    propose_ms: tuple[float, ...]
    solve_ms: tuple[float, ...]
    kernels: tuple[float, ...]
    exponent: float
    solve_exponent: float | None

    def to_mapping(self) -> dict[str, Any]:
        """Write it for JSON."""
        return asdict(self)


def exponent_of(sizes: Sequence[float], times: Sequence[float]) -> float:
    """Exponent of the power law that fits best in the logarithm; NaN if there are no two."""
    if len(times) < 2 or min(times) <= 0.0:
        return float("nan")
    slope, _ = np.polyfit(np.log(sizes), np.log(times), 1)
    return float(slope)


def measure_growth(backend: str, ticks: int) -> dict[str, Any]:
    """One backend in this process: medians by number of pieces."""
    tuning = replace(Tuning(), algorithm="mpc", backend=backend)
    propose: list[float] = []
    solve: list[float] = []
    kernels: list[float] = []
    machine = load_machine("t2-compact")
    with quiet(0):
        for pieces in PIECES:

            def make(
                machine: Machine, chosen: Tuning, period: float, count: int = pieces
            ) -> Cueing:
                return SixAxis(machine, chosen, period, pieces=count)

            times = time_plans(machine, tuning, ticks, paced=False, make=make, begin=LIVELY)
            propose.append(float(np.median(times.propose)) / 1e6)
            kernels.append(float(np.median(times.propose) / np.median(times.kernel)))
            if SOLVE in times.parts:
                solve.append(float(np.median(times.parts[SOLVE])) / 1e6)
    found = Growth(
        backend,
        PIECES,
        tuple(propose),
        tuple(solve),
        tuple(kernels),
        exponent_of(PIECES, kernels),
        exponent_of(PIECES, solve) if solve else None,
    )
    return found.to_mapping()


def bench_growth(ticks: int, backends: Sequence[str]) -> list[dict[str, Any]]:
    """Measure all backends, each in a process of its own, as fast as they go."""
    out = []
    for backend in backends:
        arguments = (backend, str(min(ticks, MOST_TICKS)))
        with Helper("motionserver.evaluate.bench.plan_growth", *arguments) as helper:
            out.append(helper.result())
    return out


def growth_text(found: Sequence[dict[str, Any]]) -> str:
    """A table for people."""
    head = "".join(f"{pieces:>9}" for pieces in PIECES)
    lines = [f"{'propose by pieces, p50':<26}{head}  [ms]  exponent  of the solver"]
    for one in found:
        times = "".join(f"{time:9.3f}" for time in one["propose_ms"])
        alone = one["solve_exponent"]
        powers = f"{one['exponent']:10.2f}" + ("" if alone is None else f"{alone:15.2f}")
        lines.append(f"{'  mpc ' + one['backend']:<26}{times}      {powers}")
    return "\n".join(lines)


if __name__ == "__main__":
    say(measure_growth(sys.argv[1], int(sys.argv[2])))
