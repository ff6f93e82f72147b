"""Taking over from a guard that ended: check what it left, and go on with the next sample."""

from __future__ import annotations

from typing import Final

import numpy as np

from motionserver.core.device import Feedback, Phase
from motionserver.core.kinematics.hexapod import leg_speeds
from motionserver.core.motion.player import Playback, state_now
from motionserver.core.safety.accept import accept_again
from motionserver.core.safety.act import Guard
from motionserver.core.safety.states import State
from motionserver.core.safety.verdict import AcceptedPlan, Rejection
from motionserver.core.safety.watchdog import SECOND, measured_legs
from motionserver.core.safety.will import Will

LONGEST_GAP: Final = 0.1
"""Age of the packet that was due up to which the next sample is still soft [s]: later the platform
stands, and what follows must begin at rest."""
QUIET: Final = 1.0
"""A guard that took over lives at least so long, or its successor does not go on as it did [s]:
what it was left may be what killed it."""


def inherit(guard: Guard, will: Will, now_ns: int, is_sent: bool = True) -> bool:
    """Let a fresh guard take the place of the one that left ``will``.

    Latched states stay latched however old the will is, and an edge that was used stays used. The
    plans are checked again from the beginning: nothing is believed but the bytes.

    Args:
        guard: A guard that has not ticked yet.
        will: What the one before left.
        now_ns: Now [ns].
        is_sent: Whether the packet that the will tells of went out; else it is the next one.

    Returns:
        True if the same plan goes on; False if it must begin from where the platform is measured.
    """
    record = guard.record
    record.leaving, record.engaged_once = will.leaving, will.engaged_once
    record.next_id, record.accepted_ns = will.next_id, will.accepted_ns
    record.counters.update(will.counters)
    record.deadline_ns = will.deadline_ns
    record.counters["takeovers"] += 1
    latched = will.state in (State.FAULT, State.SAFE)
    late = (now_ns - will.due_ns) / SECOND
    playback: Playback | None = None
    why: str | None = None
    if late > LONGEST_GAP:
        why = f"its packet was due {late * 1e3:.0f} ms ago"
    elif will.taken_ns and now_ns - will.taken_ns < QUIET * SECOND:
        why = "it had taken over itself just before"
    elif will.plans:
        found = _played(guard, will)
        if isinstance(found, str):
            why = found
        else:
            why = _astray(guard, will.feedback, found)
            playback = None if why else found
    if why and not latched:
        record.note(now_ns, f"the guard before ended in {will.state}; begins anew: {why}")
        return False
    record.state, record.reason, record.since_ns = will.state, will.reason, will.since_ns
    record.playback, record.sent_legs = playback, will.sent_legs
    guard.owes_sample = not is_sent
    guard.supervisor.resume(will.feedback, record.accepted_ns, now_ns)
    how = "stays" if why else "goes on"
    record.note(now_ns, f"the guard before ended in {will.state}; {how} in it")
    return True


def _played(guard: Guard, will: Will) -> Playback | str:
    """What was played and waited, each plan accepted again; or why it is not gone on with."""
    accepted: list[AcceptedPlan] = []
    before = will.before
    for plan in will.plans:
        # a rest where it was measured has a straight way to neutral, perhaps to nowhere else
        homes = guard.homes[:1] if before is None else guard.homes
        verdict = accept_again(guard.machine, plan, before, homes)
        if isinstance(verdict, Rejection):
            return str(verdict)
        accepted.append(verdict)
        before = plan
    return Playback(accepted[0], will.clock, tuple(accepted[1:]))


def _astray(guard: Guard, feedback: Feedback | None, playback: Playback) -> str | None:
    """Why the raised platform cannot be where the plan's clock says; None if it can."""
    if feedback is None or feedback.phase is not Phase.UP:
        return None
    measured = measured_legs(guard.machine, feedback)
    if measured is None:
        return None
    state = state_now(playback)
    legs, speeds = leg_speeds(guard.machine, state.pose[None], state.velocity[None])
    gap = np.abs(measured - legs[0])
    if bool((gap <= guard.supervisor.device.allowed(speeds[0])).all()):
        return None
    return f"the platform is {1e3 * gap.max():.0f} mm from its plan"
