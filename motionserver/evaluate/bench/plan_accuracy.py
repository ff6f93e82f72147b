"""What a backend's error costs: beside the exact optimum, and in a loop of its own.

Run as ``python -m motionserver.evaluate.bench.plan_accuracy TICKS BACKEND...``.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from typing import Any, Final

import numpy as np

from motionserver.core.axes import Array
from motionserver.core.limits import Machine
from motionserver.core.plan import Plan
from motionserver.core.state import PlatformState, Stimulus
from motionserver.cueing.base import Candidate, Cueing, Report
from motionserver.cueing.registry import make_cueing
from motionserver.cueing.tuning import Tuning
from motionserver.evaluate.bench.plan_steps import LIVELY, time_plans
from motionserver.evaluate.bench.processes import Helper, say
from motionserver.settings.machine import load_machine
from motionserver.solvers.registry import REFERENCE

MOST_TICKS: Final = 1500
BAR: Final = 0.01
"""Force error beyond the exact loop's, as a share of it, that still counts as the same."""


@dataclass(frozen=True, slots=True)
class Accuracy:
    """One backend against the reference.

    Attributes:
        backend: QP backend.
        ticks: Periods of the drive.
        force_rmse: Felt minus wanted specific force in a loop of its own, rms [m/s2].
        excess: The same beyond that of the reference's loop, as a share of it.
        within_bar: Whether that is at most `BAR`.
        first_move_p50: Difference of the first period's translational acceleration from the
            reference's, from the same state, median [m/s2].
        first_move_p99: [m/s2].
        first_move_max: [m/s2].
        failed: Share of periods without a candidate where the reference had one.
        no_plan: Share of periods without a candidate in its own loop.
        refused: Share of periods in which no part of its candidate passed.
    """

    backend: str
    ticks: int
    force_rmse: float
    excess: float
    within_bar: bool
    first_move_p50: float
    first_move_p99: float
    first_move_max: float
    failed: float
    no_plan: float
    refused: float


@dataclass(slots=True)
class Beside:
    """The reference at the wheel; others are asked the same and compared.

    Attributes:
        wheel: Whose plans are driven.
        others: Who is compared, by name.
        differences: Of their first moves [m/s2].
        failures: How often they had no candidate.
    """

    wheel: Cueing
    others: dict[str, Cueing]
    name: str = "beside"
    differences: dict[str, list[float]] = field(default_factory=dict)
    failures: dict[str, int] = field(default_factory=dict)

    @property
    def disturbance(self) -> Array:
        """The wheel's."""
        return self.wheel.disturbance

    @disturbance.setter
    def disturbance(self, value: Array) -> None:
        for one in (self.wheel, *self.others.values()):
            one.disturbance = value

    def propose(
        self, start: PlatformState, parent: Plan, takeover: float, stimulus: Stimulus
    ) -> Candidate | None:
        """Ask everybody, drive the reference's."""
        best = self.wheel.propose(start, parent, takeover, stimulus)
        for name, other in self.others.items():
            found = other.propose(start, parent, takeover, stimulus)
            if best is None:
                continue
            if found is None:
                self.failures[name] = self.failures.get(name, 0) + 1
                continue
            first = found.acceleration[1, :3] - best.acceleration[1, :3]
            self.differences.setdefault(name, []).append(float(np.linalg.norm(first)))
        return best

    def adopt(self, plan: Plan, kappa: float) -> None:
        """Everybody's."""
        for one in (self.wheel, *self.others.values()):
            one.adopt(plan, kappa)

    def retune(self, tuning: Tuning) -> None:
        """Refused: each has its own backend, and a benchmark's drive is not tuned."""
        raise NotImplementedError("the drive of a benchmark is not tuned")

    def report(self) -> Report:
        """The wheel's."""
        return self.wheel.report()


def measure_accuracy(ticks: int, backends: Sequence[str]) -> list[dict[str, Any]]:
    """Drive the reference with all others beside it, then each by itself."""
    machine = load_machine("t2-compact")
    base = replace(Tuning(), algorithm="mpc")
    made: list[Beside] = []

    def beside(at: Machine, tuning: Tuning, period: float) -> Cueing:
        others = {name: make_cueing(at, replace(tuning, backend=name), period) for name in backends}
        made.append(Beside(make_cueing(at, replace(tuning, backend=REFERENCE), period), others))
        return made[0]

    drive = partial(time_plans, machine, ticks=ticks, paced=False, begin=LIVELY)
    best = drive(tuning=base, make=beside).force_rmse()
    out = []
    for name in backends:
        own = drive(tuning=replace(base, backend=name))
        moves = np.asarray(made[0].differences.get(name, [float("nan")]))
        excess = own.force_rmse() / best - 1.0
        found = Accuracy(
            name,
            ticks,
            own.force_rmse(),
            excess,
            excess <= BAR,
            float(np.median(moves)),
            float(np.quantile(moves, 0.99)),
            float(moves.max()),
            made[0].failures.get(name, 0) / ticks,
            own.outcomes["no plan"] / ticks,
            own.outcomes["refused"] / ticks,
        )
        out.append(asdict(found))
    return [*out, {"backend": REFERENCE, "ticks": ticks, "force_rmse": best}]


def bench_accuracy(ticks: int, backends: Sequence[str]) -> list[dict[str, Any]]:
    """Measure in a process of its own, as fast as it goes; the last entry is the reference."""
    arguments = (str(min(ticks, MOST_TICKS)), *backends)
    with Helper("motionserver.evaluate.bench.plan_accuracy", *arguments) as helper:
        found: list[dict[str, Any]] = helper.result()["found"]
    return found


def accuracy_text(found: Sequence[dict[str, Any]]) -> str:
    """A table for people."""
    lines = [
        f"{'error beside the optimum':<26}{'force rms':>10}{'excess':>9}"
        f"{'first move p50':>16}{'p99':>9}{'max':>9}  [m/s2]"
    ]
    for one in found:
        line = f"{'  mpc ' + one['backend']:<26}{one['force_rmse']:10.4f}"
        if "excess" in one:
            moves = [one[f"first_move_{cut}"] for cut in ("p50", "p99", "max")]
            line += f"{one['excess']:9.2%}{moves[0]:16.1e}{moves[1]:9.1e}{moves[2]:9.1e}"
            line += "" if one["within_bar"] else f"  beyond {100 * BAR:g} %"
        lines.append(line)
    return "\n".join(lines)


if __name__ == "__main__":
    say({"found": measure_accuracy(int(sys.argv[1]), sys.argv[2:])})
