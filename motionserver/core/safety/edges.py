"""An operator's edges: what engage, park and reset are answered, and what they wish."""

from __future__ import annotations

from motionserver.core.safety.given import GuardConfig, Request, TickInput
from motionserver.core.safety.record import GuardRecord
from motionserver.core.safety.return_decision import ReturnDecision
from motionserver.core.safety.states import Event, State
from motionserver.core.safety.supervisor import Supervisor, is_standing
from motionserver.core.safety.watchdog import SECOND, Patience


def edges(
    config: GuardConfig, record: GuardRecord, supervisor: Supervisor, given: TickInput
) -> tuple[tuple[str, ...], frozenset[Event]]:
    """Answer the requests of a tick.

    Args:
        config: Who may engage.
        record: The guard's state; a granted reset is noted in it, requests are counted.
        supervisor: What is known of device and source.
        given: What came in.

    Returns:
        One answer per request, empty = granted, and the events they wish.
    """
    now = given.now_ns
    wishes: set[Event] = set()
    answers: list[str] = []
    for request in given.requests:
        record.counters[f"request_{request.op}"] += 1
        if request.op == "park":
            refusal = _park(record, supervisor.return_decision)
            if not refusal:
                wishes.add(Event.PARK)
        elif request.op == "reset":
            refusal = _reset(config, record, supervisor, now)
        elif request.op != "engage":
            refusal = f"unknown request {request.op!r}; allowed: engage, park, reset"
        else:
            refusal = _engage(config, record, supervisor, request, now)
            if not refusal:
                wishes.add(Event.ENGAGE)
        if refusal:
            record.counters["request_refused"] += 1
        answers.append(refusal)
    if config.engage == "auto" and not record.engaged_once and not supervisor.refusal(record, now):
        record.engaged_once = True
        wishes.add(Event.ENGAGE)
    return tuple(answers), frozenset(wishes)


def judge_reset(
    patience: Patience, record: GuardRecord, supervisor: Supervisor, now_ns: int
) -> None:
    """Tell once that a granted reset had no effect in its time, and why."""
    if 0 < record.reset_until_ns <= now_ns:
        why = supervisor.why_not_reset(now_ns)
        record.reset_until_ns = 0
        record.reset_failure = f"a reset had no effect for {patience.reset:g} s: {why}"
        record.note(now_ns, record.reset_failure)


def _park(record: GuardRecord, decision: ReturnDecision) -> str:
    """Why nothing follows from asking to park; empty where it is parked, or parks."""
    if record.state is State.OFFLINE:
        return "the device does not answer; it is parked as soon as it answers"
    if record.state is State.SAFE:
        return (
            "the emergency stop is followed, nothing is moved; once it is closed and the cause is "
            "gone, reset: that parks"
        )
    return decision.status if record.state is State.FAULT and decision.is_blocked else ""


def _engage(
    config: GuardConfig, record: GuardRecord, supervisor: Supervisor, request: Request, now_ns: int
) -> str:
    if request.by not in ("console", config.engage):
        return f"engaging by {request.by} is off: [operator] engage = {config.engage!r}"
    if request.by == "http" and not request.enabled:
        return "the enable input is open: somebody at the platform must hold it"
    return supervisor.refusal(record, now_ns)


def _reset(config: GuardConfig, record: GuardRecord, supervisor: Supervisor, now_ns: int) -> str:
    if record.state not in (State.FAULT, State.SAFE):
        return f"the state is {record.state}; there is nothing to reset"
    if not is_standing(record.playback):
        return "the platform still moves; reset when it stands"
    record.reset_until_ns = now_ns + int(config.patience.reset * SECOND)
    record.reset_failure = ""
    supervisor.inconsistent = ""
    supervisor.astray = False
    return ""
