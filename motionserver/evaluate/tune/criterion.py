"""What "better" means, and what a tuning may not buy it with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import degrees
from typing import Final

from motionserver.errors import ConfigError
from motionserver.evaluate.tune.outcome import Outcome

CRITERIA: Final = {
    "rmse": "nRMSE of f_x and f_y together, mean over the recordings; 1 is standing still",
    "incongruence": "peak of the motion-incongruence rating over that of standing still, mean "
    "over the recordings",
    "sickness": "nRMSE of f_x and f_y plus a weight times the W_f-weighted rms of the felt "
    "specific force, mean over the recordings",
}
"""Names with their meaning."""
SICKNESS_WEIGHT: Final = 1.0
"""Price of 1 m/s2 of weighted force in units of nRMSE [s2/m]."""
TILT_ROOM: Final = 1.1
"""Most that tilting may exceed the threshold, or the default where that is faster already."""
OTHER_ROOM: Final = 1.25
"""Most that the errors of heave and of turning may exceed those of the default."""


@dataclass(frozen=True, slots=True)
class Criterion:
    """A way to score one drive; less is better.

    Attributes:
        name: One of `CRITERIA`.
        sickness_weight: Only of the criterion "sickness" [s2/m].
    """

    name: str = "rmse"
    sickness_weight: float = SICKNESS_WEIGHT

    def __post_init__(self) -> None:
        if self.name not in CRITERIA:
            raise ConfigError(
                "--criterion", f"unknown {self.name!r}", f"Allowed: {', '.join(CRITERIA)}."
            )
        if not 0.0 <= self.sickness_weight <= 100.0:
            raise ConfigError(
                "--sickness-weight", f"{self.sickness_weight:g} is out of range", "Give 0 to 100."
            )

    @property
    def meaning(self) -> str:
        """What it is, in words."""
        weight = f" (weight {self.sickness_weight:g} per m/s2)" if self.name == "sickness" else ""
        return CRITERIA[self.name] + weight

    def score(self, outcome: Outcome) -> float:
        """Score of one drive."""
        if self.name == "incongruence":
            return outcome.incongruence
        extra = self.sickness_weight * outcome.sickness if self.name == "sickness" else 0.0
        return outcome.nrmse + extra

    def mean(self, outcomes: Sequence[Outcome]) -> float:
        """Score over several recordings."""
        return sum(self.score(outcome) for outcome in outcomes) / len(outcomes)


def objection(
    outcomes: Mapping[str, Outcome], default: Mapping[str, Outcome], tilt_threshold: float
) -> str:
    """Why a trial is out of the running, judged on these recordings only; empty if it is not.

    A hard limit broken, or a plan that the guard's verification rejects, always disqualifies. And
    since every criterion looks at forces alone, a search would sell whatever else costs force:
    tilting that nobody should notice, heave, turning. So these may not get much worse than they
    are with the defaults.

    Args:
        outcomes: Of the trial, by recording.
        default: Of the default tuning, by recording; at least the same ones.
        tilt_threshold: Perception threshold of tilt [rad/s].
    """
    for name, outcome in outcomes.items():
        if outcome.violations:
            return f"{outcome.violations} samples beyond a limit on {name} ({outcome.broken})"
        if outcome.rejected:
            return f"{outcome.rejected} plans rejected by the guard's check on {name}"
    count = len(outcomes)
    tilt = sum(o.tilt_p99 for o in outcomes.values()) / count
    usual = sum(default[name].tilt_p99 for name in outcomes) / count
    allowed = TILT_ROOM * max(tilt_threshold, usual)
    if tilt > allowed:
        return f"tilts at {degrees(tilt):.2f} deg/s (p99), allowed are {degrees(allowed):.2f}"
    for what, unit, field in (
        ("f_z", "m/s2", "rmse_heave"),
        ("turning", "rad/s", "rmse_rates"),
    ):
        now = sum(float(getattr(o, field)) for o in outcomes.values()) / count
        before = sum(float(getattr(default[name], field)) for name in outcomes) / count
        if now > OTHER_ROOM * before + 1e-9:
            return f"RMSE of {what} {now:.3f} {unit}, allowed are {OTHER_ROOM * before:.3f}"
    return ""
