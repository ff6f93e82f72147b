"""What the planner shows: timing, forces, source, solver, as one JSON object."""

from __future__ import annotations

import json
import os
from collections import Counter, deque
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from motionserver.core.axes import GRAVITY, Array
from motionserver.core.state import STILL, Stimulus
from motionserver.cueing.base import Report
from motionserver.cueing.measured import MeasuredForce
from motionserver.cueing.think import Thinker, Thought
from motionserver.planner.inputs import Inputs
from motionserver.planner.sides import Sides
from motionserver.planner.source_notices import notices_of, sensor_notices
from motionserver.planner.spare_time import KEPT, expected_ns
from motionserver.planner.tuner import Tuner
from motionserver.telemetry.ticker import Lateness
from motionserver.telemetry.trace import Trace

GUESS_NS: Final = 5_000_000
"""How long the first plan will take [ns]."""


class Timing:
    """How late it wakes and how long it thinks."""

    def __init__(self, period_ns: int) -> None:
        self.lateness = Lateness(period_ns)
        self._thoughts: deque[int] = deque(maxlen=1024)
        self.late_ns = self.last_ns = 0

    def woke(self, late_ns: int) -> None:
        """Note a wake-up."""
        self.late_ns = max(0, late_ns)
        self.lateness.ticked(self.late_ns)

    def thought(self, took_ns: int) -> None:
        """Note how long a plan took, from waking to proposing."""
        self.last_ns = took_ns
        self._thoughts.append(took_ns)

    @property
    def expected_ns(self) -> int:
        """How long the next plan will take, on the careful side [ns]."""
        return expected_ns(list(self._thoughts)[-KEPT:], GUESS_NS)

    def summary(self) -> dict[str, float]:
        """Percentiles of plan times [ms]."""
        times = sorted(self._thoughts) or [0]
        last = self._thoughts[-1] if self._thoughts else 0
        return {
            "time_p50_ms": times[len(times) // 2] / 1e6,
            "time_p99_ms": times[int(0.99 * (len(times) - 1))] / 1e6,
            "last_ms": last / 1e6,
        }


def _numbers(values: Array) -> list[float]:
    return [round(float(value), 5) for value in values]


def _limits(report: Report | None) -> list[float | None]:
    """Position limits that are in force; None on an axis that has none of its own."""
    if report is None:
        return [None] * 6
    return [
        value if axis in report.bounded else None
        for axis, value in enumerate(_numbers(report.x_max))
    ]


class PlannerView:
    """Remembers the last thought and writes the snapshot."""

    def __init__(self) -> None:
        self._thought: Thought | None = None
        self._stimulus: Stimulus = STILL
        self._felt: Array = np.zeros(3)
        self._counters: Counter[str] = Counter()
        self._last_count = (0, 0)
        self._rate = 0.0

    def note(self, thought: Thought, stimulus: Stimulus, felt_force: Array, algorithm: str) -> None:
        """Take the last period's outcome, of the algorithm that drove it."""
        self._thought, self._stimulus, self._felt = thought, stimulus, felt_force
        self._counters["plans_thought"] += 1
        self._counters[f"plans_thought_{algorithm}"] += 1
        if thought.proposal is None:
            self._counters["no_plan"] += 1
            self._counters[f"no_plan_{algorithm}"] += 1
        elif thought.proposal.kappa == 0.0:
            self._counters["plans_refused"] += 1
            self._counters[f"plans_refused_{algorithm}"] += 1
        elif thought.proposal.kappa < 1.0:
            self._counters["plans_halved"] += 1

    def trace(
        self,
        now_ns: int,
        stimulus: Stimulus,
        thinker: Thinker,
        sides: Sides,
        timing: Timing,
        has_thought: bool,
    ) -> bytes:
        """What recorder and black box keep of every period; see `telemetry.trace`."""
        proposal = None if self._thought is None else self._thought.proposal
        trouble = "" if self._thought is None else self._thought.trouble
        return Trace(
            now_ns,
            thinker.tuning.algorithm,
            None if proposal is None else proposal.kappa,
            tuple(stimulus.force.tolist()),
            tuple(self._felt.tolist()),
            {name: (*force.tolist(), kappa) for name, (force, kappa) in sides.forces().items()},
            proposal.plan.plan_id if has_thought and proposal is not None else 0,
            timing.last_ns * 1e-9 if has_thought else 0.0,
            timing.late_ns * 1e-9,
            trouble[:100] if has_thought else "",
        ).pack()

    def counted(self, inputs: Inputs, sides: Sides) -> dict[str, Any]:
        """What the black box keeps once a second: owner, last refusal, counters."""
        owner = inputs.vehicle.owner
        return {
            "owner": None if owner is None else f"{owner.source} from {owner.address}",
            "last_error": inputs.last_error[:300],
            "counters": self._counted(inputs, sides),
        }

    def _counted(self, inputs: Inputs, sides: Sides) -> dict[str, int]:
        return {
            **inputs.counters,
            **self._counters,
            "lost_packets": inputs.vehicle.lost,
            "switches": sides.switches,
        }

    def snapshot(
        self,
        now_ns: int,
        thinker: Thinker,
        inputs: Inputs,
        timing: Timing,
        tuner: Tuner,
        measured: MeasuredForce,
        sides: Sides,
        handover: Mapping[str, Any],
    ) -> bytes:
        """Write everything as JSON."""
        thought, gate = self._thought, inputs.vehicle
        age = gate.freshness.age_ns(now_ns)
        notices = [one.text for one in notices_of(inputs, now_ns)]
        notices += sensor_notices(inputs, now_ns)
        is_paused = inputs.is_paused_by_silence(now_ns)
        proposal = None if thought is None else thought.proposal
        report = None if thought is None else thought.report
        measured_force = None
        if measured.latest is not None:
            measured_force = _numbers(measured.latest - np.array([0.0, 0.0, GRAVITY]))
        ticks = timing.lateness.ticks
        if now_ns - self._last_count[0] > 500_000_000:
            elapsed = (now_ns - self._last_count[0]) / 1e9
            self._rate = (ticks - self._last_count[1]) / elapsed if self._last_count[0] else 0.0
            self._last_count = (now_ns, ticks)
        shown: dict[str, Any] = {
            "pid": os.getpid(),
            "t_ns": now_ns,
            "algorithm": thinker.tuning.algorithm,
            "x_max": _limits(report),
            "limit_shares": {} if report is None else report.shares,
            "wanted_force": _numbers(self._stimulus.force),
            "wanted_rates": _numbers(self._stimulus.rates),
            "felt_force": _numbers(self._felt),
            "measured_force": measured_force,
            "disturbance": _numbers(measured.disturbance),
            "tracking": {"mismatch": round(measured.mismatch, 4), "alarm": measured.alarm},
            "gain": round(self._stimulus.gain, 4),
            "source": {
                "kind": None if inputs.owner_input is None else inputs.owner_input.options.kind,
                "address": None if gate.owner is None else gate.owner.address,
                "session": None if gate.owner is None else gate.owner.session,
                "age_s": None if age is None else round(age / 1e9, 4),
                "rate_hz": round(gate.freshness.rate_hz(), 2),
                "mode": "pause" if is_paused else gate.mode.name.lower(),
                "fresh": gate.is_fresh(now_ns),
                "bad_share": round(gate.spoilage.share(now_ns), 3),
                "notices": notices,
                "last_error": ("; ".join(notices) or inputs.last_error)[:300],
                "filters": inputs.filters,
            },
            "solver": {
                "backend": thinker.tuning.backend,
                "iterations": 0 if report is None else report.iterations,
                "status": "none" if report is None else report.solver_status,
                **timing.summary(),
            },
            "handover": handover,
            "reference": "" if report is None else report.reference,
            "kappa": None if proposal is None else proposal.kappa,
            "trouble": "" if thought is None else thought.trouble[:300],
            "refused_because": [str(r) for r in proposal.refusals][:1] if proposal else [],
            "counters": self._counted(inputs, sides),
            "side": sides.shown(thinker.tuning.algorithm),
            "tuning": tuner.shown(thinker),
            "tick": timing.lateness.summary(),
            "rates_hz": {"planner": round(self._rate, 2)},
        }
        return json.dumps(shown).encode()
