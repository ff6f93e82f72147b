"""The motion states: everything that changes state is in this table, and nowhere else."""

from __future__ import annotations

from enum import StrEnum
from typing import Final


class State(StrEnum):
    """What the platform is doing."""

    OFFLINE = "OFFLINE"
    PARKED = "PARKED"
    RAISING = "RAISING"
    READY = "READY"
    RUN = "RUN"
    HOLD = "HOLD"
    PARKING = "PARKING"
    FAULT = "FAULT"
    SAFE = "SAFE"


class Event(StrEnum):
    """What can happen, worst first: of several in one tick the first that leads away wins."""

    ESTOP = "the emergency stop or an interlock is open"
    INCONSISTENT = "the guard found itself inconsistent"
    DEVICE_FAULT = "the device reports a fault"
    FEEDBACK_LOST = "no valid feedback from the device"
    TRACKING_ERROR = "the platform does not follow"
    PARK_TIMEOUT = "parking took twice its bound"
    PARK = "park was asked for"
    RAISE_TIMEOUT = "the platform did not reach neutral in time"
    HOLD_EXPIRED = "held for too long"
    SOURCE_SILENT = "no source for too long"
    LOOP_GAP = "the guard's own loop stood still"
    TROUBLE = "the source is stale or pauses, or no plan was accepted"
    DEVICE_DOWN = "the device is down"
    DEVICE_UP = "the device is raised"
    RAISED = "neutral is reached"
    ENGAGE = "an operator engaged"
    CUEING = "the source is fresh and plans are accepted"
    RESET_BLIND = "an operator reset, the device is silent"
    RESET_UP = "an operator reset, the device is raised"
    RESET_DOWN = "an operator reset, the device is down"


_DOWNSTREAM: Final = {
    Event.ESTOP: State.SAFE,
    Event.INCONSISTENT: State.FAULT,
    Event.DEVICE_FAULT: State.FAULT,
    Event.FEEDBACK_LOST: State.FAULT,
    Event.TRACKING_ERROR: State.FAULT,
}
_RESET: Final = {
    Event.RESET_BLIND: State.OFFLINE,
    Event.RESET_UP: State.PARKING,
    Event.RESET_DOWN: State.PARKED,
}

TABLE: Final[dict[State, dict[Event, State]]] = {
    State.OFFLINE: {
        Event.ESTOP: State.SAFE,
        Event.INCONSISTENT: State.FAULT,
        Event.DEVICE_FAULT: State.FAULT,
        Event.DEVICE_DOWN: State.PARKED,
        Event.DEVICE_UP: State.PARKING,
    },
    State.PARKED: {
        Event.ESTOP: State.SAFE,
        Event.DEVICE_FAULT: State.FAULT,
        Event.FEEDBACK_LOST: State.OFFLINE,
        Event.DEVICE_UP: State.PARKING,
        Event.ENGAGE: State.RAISING,
    },
    State.RAISING: {
        **_DOWNSTREAM,
        Event.PARK: State.PARKING,
        Event.RAISE_TIMEOUT: State.PARKING,
        Event.RAISED: State.READY,
    },
    State.READY: {
        **_DOWNSTREAM,
        Event.PARK: State.PARKING,
        Event.SOURCE_SILENT: State.PARKING,
        Event.LOOP_GAP: State.HOLD,
        Event.CUEING: State.RUN,
    },
    State.RUN: {
        **_DOWNSTREAM,
        Event.PARK: State.PARKING,
        Event.LOOP_GAP: State.HOLD,
        Event.TROUBLE: State.HOLD,
    },
    State.HOLD: {
        **_DOWNSTREAM,
        Event.PARK: State.PARKING,
        Event.HOLD_EXPIRED: State.PARKING,
        Event.CUEING: State.RUN,
    },
    State.PARKING: {
        **_DOWNSTREAM,
        Event.PARK_TIMEOUT: State.FAULT,
        Event.DEVICE_DOWN: State.PARKED,
    },
    # an open stop is followed whatever the fault: the rest of the plan is not played against it
    State.FAULT: {Event.ESTOP: State.SAFE, **_RESET},
    State.SAFE: _RESET,
}
"""Cells that lead somewhere else; in every other cell the state stays."""

RAISED: Final = frozenset({State.RAISING, State.READY, State.RUN, State.HOLD, State.PARKING})
"""States in which the platform is up or on its way."""
CUED: Final = frozenset({State.READY, State.RUN, State.HOLD})
"""States in which a planner's plans are played."""

LATCHED: Final = frozenset({State.FAULT, State.SAFE})
"""States that only an operator's reset makes ready again."""


def after(state: State, event: Event) -> State:
    """The state that follows ``event`` in ``state``."""
    return TABLE[state].get(event, state)


def diagram() -> str:
    """The table as a Mermaid state diagram, for the documents."""
    lines = ["stateDiagram-v2", "    [*] --> OFFLINE"]
    for state, row in TABLE.items():
        targets: dict[State, list[str]] = {}
        for event, target in row.items():
            targets.setdefault(target, []).append(event.name.lower().replace("_", " "))
        lines += [f"    {state} --> {to} : {', '.join(why)}" for to, why in targets.items()]
    return "\n".join(lines)
