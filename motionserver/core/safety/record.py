"""The guard's whole state in one record, and what it notes for people."""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import dataclass, field

from motionserver.core.axes import Array
from motionserver.core.motion.player import Playback
from motionserver.core.safety.states import State
from motionserver.core.safety.verdict import Reason, Rejection


@dataclass(slots=True)
class GuardRecord:
    """State, plan, plan clock, counters.

    Attributes:
        state: Motion state.
        reason: Why it is in this state, for people.
        since_ns: When it was entered [ns].
        playback: What is played; None while nothing is.
        deadline_ns: When raising or parking has taken too long [ns].
        accepted_ns: When the last proposal was accepted [ns].
        reset_until_ns: Until when a reset is being tried [ns].
        leaving: True once the service is to end: park, and engage no more.
        engaged_once: True once "auto" has used its single edge.
        next_id: Number of the guard's next own plan.
        counters: Everything that is counted, by name.
        events: Newest (instant [ns], text), for people.
        rejections: Newest (instant [ns], rejection).
        sent_legs: Where the device was sent last, (6,) [m]; None once it has moved by itself.
        judged_id: Number of the newest proposal that was decided about; 0 = none.
        refusal: Why that one was refused; None if it was accepted.
        reset_failure: Why the newest reset had no effect, for people; empty if it had, or is tried.
    """

    state: State = State.OFFLINE
    reason: str = "started; waiting for the device's feedback"
    since_ns: int = 0
    playback: Playback | None = None
    deadline_ns: int = 0
    accepted_ns: int = 0
    reset_until_ns: int = 0
    leaving: bool = False
    engaged_once: bool = False
    next_id: int = 1 << 63
    counters: Counter[str] = field(default_factory=Counter)
    events: deque[tuple[int, str]] = field(default_factory=lambda: deque(maxlen=40))
    rejections: deque[tuple[int, Rejection]] = field(default_factory=lambda: deque(maxlen=20))
    sent_legs: Array | None = None
    judged_id: int = 0
    refusal: Reason | None = None
    reset_failure: str = ""

    def note(self, now_ns: int, text: str) -> None:
        """Keep an event for the page and the log."""
        self.events.append((now_ns, text))

    def take_id(self) -> int:
        """A number for a plan of the guard's own."""
        self.next_id += 1
        return self.next_id
