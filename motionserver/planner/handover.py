"""Where in the accepted plan's own time the next plan takes over, and who the parent is."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil
from typing import Any, Final

from motionserver.core.motion.player import MOST_PENDING
from motionserver.core.plan import Plan, unpack
from motionserver.core.safety.states import CUED, State
from motionserver.core.safety.verdict import Reason
from motionserver.core.safety.verify import CLOSEST
from motionserver.planner.open_proposals import OpenProposals
from motionserver.telemetry.link import STATES, GuardClock, Maps

SECOND: Final = 1_000_000_000
ALIVE_NS: Final = 200_000_000
STANDS_NS: Final = 20_000_000
"""A guard so far behind its own slot, and a slot more, stands still, and its plan with it [ns]."""
KEPT: Final = 16
FALL_NS: Final = 2 * SECOND
"""Without a plan that came too late the lead falls by one slot in this time [ns]."""
ROUNDING: Final = 1e-8
"""The guard adds up periods, here they are multiplied: so much later no instant is missed [s]."""


@dataclass(frozen=True, slots=True)
class Handover:
    """The parent and the instant.

    Attributes:
        parent: The newest accepted plan, or the proposal that will be.
        before: The plan it took over from, if known here.
        takeover: Instant in the parent's own time [s].
    """

    parent: Plan
    before: Plan | None
    takeover: float


class HandoverClock:
    """Follows the guard's clock; aims at the next send slot, later ones if it keeps missing.

    Args:
        maps: The mapped files shared with the guard.
        send_period: Time between two packets to the platform [s].
        plan_period: Time between two plans [s]; that of the packets if None.
        check_ns: How long the guard takes for its verdict, beyond one tick [ns].

    Attributes:
        lead: Slots that are added because plans came too late.
        clock: What the guard said last; None while it is not heard.
        waited: Periods without a plan because two earlier ones were not decided about.
        last_refusal: Why the guard refused a proposal last; None while it has refused none.
    """

    def __init__(
        self, maps: Maps, send_period: float, plan_period: float | None = None, check_ns: int = 0
    ) -> None:
        self._maps = maps
        self._period = send_period
        self._period_ns = send_period * SECOND
        own = send_period if plan_period is None else plan_period
        # one slot further, and as many plans would wait as the guard lets wait
        self._most = MOST_PENDING * max(1, round(own / send_period)) - 1
        self._check_ns = check_ns
        self._plans: dict[int, Plan] = {}
        self._open = OpenProposals(round(own * SECOND) + 2 * check_ns)
        self._late_count: int | None = None
        self._read_ns = self._changed_ns = 0
        self.waited = 0
        self.last_refusal: Reason | None = None
        self.lead = 0
        self.clock: GuardClock | None = None

    def read(self, now_ns: int) -> State | None:
        """Read the guard's clock.

        Returns:
            The guard's state; None if no guard has written for a while.
        """
        self._read_ns = now_ns
        message = self._maps.clock.read()
        self.clock = None if message is None else GuardClock.unpack(message[1])
        if self.clock is None or now_ns - self.clock.written_ns > ALIVE_NS:
            self.clock = None
            return None
        self.last_refusal = self.clock.refused_because or self.last_refusal
        return STATES[self.clock.state]

    def shown(self) -> dict[str, Any]:
        """What the page tells of the hand-over."""
        return {
            "lead_slots": self.lead,
            "last_refusal": self.last_refusal,
            "waiting": 0 if self.clock is None else self.clock.waiting,
            "periods_waited": self.waited,
        }

    def handover(self, now_ns: int, expected_ns: int) -> Handover | None:
        """Choose parent and instant for a plan that will be ready in ``expected_ns`` [ns]."""
        clock = self.clock
        if clock is None or STATES[clock.state] not in CUED:
            return None
        if now_ns - clock.due_ns > max(self._period_ns, STANDS_NS):
            # a plan for an instant guessed from the time that passes would wait for it too long
            return None
        parent, at = self._plan(clock.newest_id), clock.newest_clock
        if parent is None:
            return None
        self._learn(clock, now_ns)
        self._open.forget(clock, now_ns)
        if self._open.are_too_many:
            self.waited += 1
            return None
        proposed = self._open.newest
        if proposed is not None and self._will_be_accepted(proposed, clock, now_ns):
            parent, at = proposed, at - proposed.takeover
        slots = min(self._sends_until(now_ns + expected_ns, clock) + self.lead, self._most)
        takeover = max(at + slots * self._period + ROUNDING, 0.0)
        before = self._plans.get(parent.parent_id)
        if parent.parent_id != parent.plan_id:
            takeover = max(takeover, CLOSEST)
        return Handover(parent, before, takeover)

    def may_propose(self, plan: Plan, now_ns: int) -> bool:
        """False while ``plan`` would replace its own parent before the guard has read that one."""
        message = self._maps.clock.read()
        if message is None:
            return False
        return not self._open.would_overwrite(plan, GuardClock.unpack(message[1]), now_ns)

    def proposed(self, plan: Plan, now_ns: int | None = None) -> None:
        """Remember a proposal of now, or of the last `read`: it may become the next parent."""
        self._plans[plan.plan_id] = plan
        self._open.add(plan, self._read_ns if now_ns is None else now_ns)
        while len(self._plans) > KEPT:
            del self._plans[min(self._plans)]

    def _plan(self, plan_id: int) -> Plan | None:
        if plan_id not in self._plans:
            message = self._maps.accepted.read()
            if message is None:
                return None
            plan = unpack(message[1])
            if plan.plan_id != plan_id:
                return None
            self._plans[plan_id] = plan
        return self._plans[plan_id]

    def _sends_until(self, instant_ns: float, clock: GuardClock) -> int:
        """How often the parent's clock will have moved on by then."""
        return max(0, ceil((instant_ns - clock.due_ns) / self._period_ns))

    def _will_be_accepted(self, plan: Plan, clock: GuardClock, now_ns: int) -> bool:
        """Whether a proposal that nothing is known of yet continues the newest plan in time."""
        verdict_ns = max(now_ns, self._open.proposed_ns + self._check_ns)
        then = clock.newest_clock + self._sends_until(verdict_ns, clock) * self._period
        return plan.parent_id == clock.newest_id and plan.takeover >= then

    def _learn(self, clock: GuardClock, now_ns: int) -> None:
        """One slot further for a plan that came too late, one nearer after a time without."""
        came_late = self._late_count is not None and clock.late_count > self._late_count
        self._late_count = clock.late_count
        if came_late:
            self.lead = min(self.lead + 1, self._most)
            self._changed_ns = now_ns
        elif self.lead and now_ns - self._changed_ns >= FALL_NS:
            self.lead -= 1
            self._changed_ns = now_ns
