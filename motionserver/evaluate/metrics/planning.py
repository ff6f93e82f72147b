"""What planning cost and what became of the candidates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from motionserver.evaluate.drive import Periods


@dataclass(frozen=True, slots=True)
class PlanningFigures:
    """One drive's planning.

    Attributes:
        periods: Planner periods.
        whole: Share of periods whose candidate went through whole (kappa = 1).
        halved: Share whose candidate was halved at least once (0 < kappa < 1).
        refused: Share whose candidate was refused altogether (kappa = 0).
        without: Share without a candidate.
        rejected: Proposals the guard's own verification rejected; must be 0.
        refusals: First reasons of the governor, with counts.
        rejections: Reasons of the guard, with counts.
        troubles: Why there was no candidate, with counts.
        unbelieved: Samples the gate refused, by counter.
        plan_p50_ms: Median time of one `think` on this computer [ms]; likewise the next three.
        plan_p99_ms: 99th percentile [ms].
        plan_p999_ms: 99.9th percentile [ms].
        plan_max_ms: Longest [ms].
        iterations_p50: Median of the solver's iterations.
        iterations_max: Most.
    """

    periods: int
    whole: float
    halved: float
    refused: float
    without: float
    rejected: int
    refusals: dict[str, int]
    rejections: dict[str, int]
    troubles: dict[str, int]
    unbelieved: dict[str, int]
    plan_p50_ms: float
    plan_p99_ms: float
    plan_p999_ms: float
    plan_max_ms: float
    iterations_p50: float
    iterations_max: int


def planning_figures(periods: Periods) -> PlanningFigures:
    """Sum up what planner and guard did."""
    kappa, took = periods.kappa, 1e3 * periods.seconds
    return PlanningFigures(
        len(kappa),
        float(np.mean(kappa == 1.0)),
        float(np.mean((kappa > 0.0) & (kappa < 1.0))),
        float(np.mean(kappa == 0.0)),
        float(np.mean(np.isnan(kappa))),
        sum(periods.rejections.values()),
        periods.refusals,
        periods.rejections,
        periods.troubles,
        periods.gate,
        float(np.percentile(took, 50)),
        float(np.percentile(took, 99)),
        float(np.percentile(took, 99.9)),
        float(took.max()),
        float(np.median(periods.iterations)),
        int(periods.iterations.max()),
    )
