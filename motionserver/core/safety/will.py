"""What a guard leaves behind with every packet: enough for a spare to send the very next one."""

from __future__ import annotations

import json
import struct
from dataclasses import asdict, dataclass, fields
from math import isfinite
from typing import Any, Final

import numpy as np

from motionserver.core.axes import Array, frozen
from motionserver.core.device import Feedback, Phase
from motionserver.core.plan import Plan, pack, unpack
from motionserver.core.safety.record import GuardRecord
from motionserver.core.safety.states import State

_LENGTH: Final = struct.Struct("<I")


@dataclass(frozen=True, slots=True)
class Will:
    """The part of a guard's record that its successor needs.

    Attributes:
        due_ns: When the packet after the last one is due [ns].
        state: Motion state.
        reason: Why it is in this state.
        since_ns: When it was entered [ns].
        deadline_ns: When raising or parking has taken too long [ns].
        accepted_ns: When the last proposal was accepted [ns].
        leaving: True once the service is to end.
        engaged_once: True once "auto" has used its single edge.
        next_id: Number of the guard's last own plan.
        taken_ns: When this guard itself took over from another [ns]; 0 = never.
        clock: Own time of the played plan at the last packet [s].
        feedback: The device's newest answer.
        counters: Everything counted so far.
        before: The plan the played one took over from; None for a rest.
        plans: The played one, then those that wait; empty if nothing is played.
        sent_legs: Where the device was sent last, (6,) [m]; None if that is unknown.
    """

    due_ns: int
    state: State
    reason: str
    since_ns: int
    deadline_ns: int
    accepted_ns: int
    leaving: bool
    engaged_once: bool
    next_id: int
    taken_ns: int
    clock: float
    feedback: Feedback | None
    counters: dict[str, int]
    before: Plan | None
    plans: tuple[Plan, ...]
    sent_legs: Array | None = None


_PLAIN: Final = tuple(
    f.name for f in fields(Will) if f.name not in ("feedback", "before", "plans", "sent_legs")
)
_KINDS: Final = {
    "state": str,
    "reason": str,
    "leaving": bool,
    "engaged_once": bool,
    "clock": float,
    "counters": dict,
}
"""What the head holds that is no instant or number, as JSON has it."""


def will_of(record: GuardRecord, feedback: Feedback | None, taken_ns: int, due_ns: int) -> Will:
    """Write down what a successor needs."""
    playback = record.playback
    accepted = () if playback is None else (playback.playing, *playback.pending)
    return Will(
        due_ns,
        record.state,
        record.reason,
        record.since_ns,
        record.deadline_ns,
        record.accepted_ns,
        record.leaving,
        record.engaged_once,
        record.next_id,
        taken_ns,
        0.0 if playback is None else playback.clock,
        feedback,
        dict(record.counters),
        accepted[0].before if accepted else None,
        tuple(each.plan for each in accepted),
        record.sent_legs,
    )


class WillWriter:
    """Packs wills; a plan is packed once for all the packets it lives."""

    def __init__(self) -> None:
        self._known: list[tuple[Plan, bytes]] = []

    def plan(self, plan: Plan) -> bytes:
        """A plan as bytes. Known again by itself: another planner may give its number again."""
        for known, packed in self._known:
            if known is plan:
                return packed
        packed = pack(plan)
        self._known.append((plan, packed))
        return packed

    def pack(self, will: Will) -> bytes:
        """As bytes, for a mapped file; plans that are not in it are forgotten."""
        plans = will.plans if will.before is None else (will.before, *will.plans)
        self._known = [(plan, self.plan(plan)) for plan in plans]
        head = {name: getattr(will, name) for name in _PLAIN}
        head["has_before"] = will.before is not None
        head["sent_legs"] = None if will.sent_legs is None else will.sent_legs.tolist()
        head["feedback"] = None if will.feedback is None else _plain(will.feedback)
        parts = [json.dumps(head).encode(), *(packed for _, packed in self._known)]
        return b"".join(_LENGTH.pack(len(part)) + part for part in parts)


def unpack_will(data: bytes) -> Will:
    """Read what `WillWriter.pack` wrote.

    Raises:
        ValueError: The bytes are no will.
    """
    try:
        parts, at = [], 0
        while at < len(data):
            (length,) = _LENGTH.unpack_from(data, at)
            parts.append(data[at + 4 : at + 4 + length])
            at += 4 + length
        head = _checked(json.loads(parts[0]))
        plans = [unpack(part) for part in parts[1:]]
        before = plans.pop(0) if head.pop("has_before") else None
        feedback, sent_legs = head.pop("feedback"), _six("sent_legs", head.pop("sent_legs"))
        return Will(
            **head | {"state": State(head["state"])},
            feedback=None if feedback is None else _feedback(feedback),
            before=before,
            plans=tuple(plans),
            sent_legs=sent_legs,
        )
    except (LookupError, TypeError, ArithmeticError, RecursionError, struct.error) as error:
        raise ValueError(f"will of a guard: {type(error).__name__}: {error}"[:200]) from error
    except ValueError as error:
        raise ValueError(f"will of a guard: {error}"[:200]) from error


def _checked(head: Any) -> dict[str, Any]:  # noqa: ANN401  (whatever JSON holds)
    """The head, if a guard can be told what is in it."""
    if not isinstance(head, dict):
        raise TypeError(f"its head is {head!r}"[:80])
    for name in _PLAIN:
        value = head[name]
        right = type(value) is _KINDS.get(name, int)
        if name == "clock":
            right = right and isfinite(value)
        elif name == "counters":
            right = right and all(type(count) is int for count in value.values())
        elif name not in _KINDS:
            right = right and 0 <= value < 1 << 64
        if not right:
            raise TypeError(f"{name} is {value!r}"[:80])
    return head


def _plain(feedback: Feedback) -> dict[str, Any]:
    out = asdict(feedback)
    for name in ("legs", "pose"):
        out[name] = None if out[name] is None else out[name].tolist()
    return out


def _feedback(plain: dict[str, Any]) -> Feedback:
    arrays = {name: _six(name, plain[name]) for name in ("legs", "pose")}
    for name, kind in (("arrival_ns", int), ("state", str), ("estop", bool), ("is_home", bool)):
        if type(plain[name]) is not kind:
            raise TypeError(f"{name} is {plain[name]!r}"[:80])
    faults = tuple(str(fault) for fault in plain["faults"])
    return Feedback(**plain | arrays | {"phase": Phase(plain["phase"]), "faults": faults})


def _six(name: str, values: Any) -> Array | None:  # noqa: ANN401  (whatever JSON holds)
    array = None if values is None else frozen(values)
    if array is not None and (array.shape != (6,) or not np.isfinite(array).all()):
        raise ValueError(f"{name} are not six numbers")
    return array
