"""What the guard is told: once at its start, and in every tick."""

from __future__ import annotations

from dataclasses import dataclass, field

from motionserver.core.device import Feedback
from motionserver.core.limits import Machine
from motionserver.core.plan import Plan
from motionserver.core.safety.watchdog import CueStatus, Patience


@dataclass(frozen=True, slots=True)
class GuardConfig:
    """What the guard is told once, at its start.

    Attributes:
        machine: Geometry and hard limits.
        send_period: Period of the platform's packets [s].
        plan_period: Period of the planner [s].
        engage: Who may engage: "console", "http" or "auto".
        patience: How long each silence is borne.
        dry_run: True: play everything, but send only the mode word, which moves nothing.
        slices: Slices of a proposal's check per tick; 0 = the whole check in the tick it comes.
    """

    machine: Machine
    send_period: float
    plan_period: float
    engage: str = "console"
    patience: Patience = field(default_factory=Patience)
    dry_run: bool = False
    slices: int = 0


@dataclass(frozen=True, slots=True)
class Request:
    """An operator's edge.

    Attributes:
        op: "engage", "park" or "reset".
        by: By which way it came: "console" or "http".
        enabled: False if an enable input is configured and somebody there does not hold it.
    """

    op: str
    by: str
    enabled: bool = True


@dataclass(frozen=True, slots=True)
class TickInput:
    """Everything that came in since the tick before.

    Attributes:
        now_ns: Now, CLOCK_MONOTONIC [ns].
        gap: Time since the tick before [s].
        is_due: True if a packet is to be sent in this tick.
        feedback: Decoded answers of the device, oldest first.
        cue: Newest status of the source, if any.
        proposal: Newest proposal of the planner, if any.
        requests: Operator's edges.
        leave: True once the service is to end.
    """

    now_ns: int
    gap: float
    is_due: bool
    feedback: tuple[Feedback, ...] = ()
    cue: CueStatus | None = None
    proposal: Plan | None = None
    requests: tuple[Request, ...] = ()
    leave: bool = False
