"""What a check of a plan can say: accepted, or rejected with reason, time and leg."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from motionserver.core.plan import Plan


class Reason(StrEnum):
    """Why a plan was not accepted."""

    MALFORMED = "malformed"
    NOT_FINITE = "not-finite"
    WRONG_PARENT = "wrong-parent"
    TOO_LATE = "too-late"
    TOO_EARLY = "too-early"
    NOT_CUEING = "not-cueing"
    NOT_AT_REST = "not-at-rest"
    DISCONTINUOUS = "discontinuous"
    LEG_LENGTH = "leg-length"
    LEG_SPEED = "leg-speed"
    LEG_ACCELERATION = "leg-acceleration"
    LEG_JERK = "leg-jerk"
    JOINT_ANGLE = "joint-angle"
    CONDITIONING = "conditioning"
    PASSENGER = "passenger-acceleration"
    NO_WAY_HOME = "no-way-home"


@dataclass(frozen=True, slots=True)
class Rejection:
    """A plan that must not be played.

    Attributes:
        reason: Which rule it breaks.
        when: Where in the plan's own time [s], if that makes sense.
        leg: Which leg, 0..5, if that makes sense.
        value: What was found, SI.
        allowed: What is allowed, SI.
    """

    reason: Reason
    when: float | None = None
    leg: int | None = None
    value: float | None = None
    allowed: float | None = None

    def __str__(self) -> str:
        parts = [f"plan rejected: {self.reason}"]
        if self.leg is not None:
            parts.append(f"leg {self.leg + 1}")
        if self.when is not None:
            parts.append(f"at {self.when:.3f} s")
        if self.value is not None and self.allowed is not None:
            parts.append(f"found {self.value:.6g}, allowed {self.allowed:.6g}")
        return ", ".join(parts)


@dataclass(frozen=True, slots=True)
class AcceptedPlan:
    """A plan that was checked in leg space. Only `core.safety` makes one.

    Attributes:
        plan: What will be played.
        before: The plan it took over from, for the samples played just before; None for a rest.
        way_home: Bound of the straight move from its rest pose to where it may be left [s].
    """

    plan: Plan
    before: Plan | None
    way_home: float
