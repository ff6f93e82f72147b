"""Where in the accepted plan's own time the next plan takes over, and who the parent is."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil
from typing import Final

from motionserver.core.plan import Plan, unpack
from motionserver.core.safety.states import CUED, State
from motionserver.core.safety.verify import CLOSEST
from motionserver.telemetry.link import STATES, GuardClock, Maps

SECOND: Final = 1_000_000_000
ALIVE_NS: Final = 200_000_000
STANDS_NS: Final = 20_000_000
"""A guard so far behind its own slot, and a slot more, stands still, and its plan with it [ns]."""
KEPT: Final = 16
PATIENCE: Final = 1
CONFIDENCE: Final = 300
MOST_LEAD: Final = 3


@dataclass(frozen=True, slots=True)
class Handover:
    """The parent and the instant.

    Attributes:
        parent: The newest accepted plan.
        before: The plan it took over from, if known here.
        takeover: Instant in the parent's own time [s].
    """

    parent: Plan
    before: Plan | None
    takeover: float


class HandoverClock:
    """Follows the guard's clock; aims at the next send slot, later ones if it keeps missing."""

    def __init__(self, maps: Maps, send_period: float) -> None:
        self._maps = maps
        self._period_ns = int(send_period * SECOND)
        self._plans: dict[int, Plan] = {}
        self._proposed_id = 0
        self._missed = 0
        self._met = 0
        self.lead = 0
        self.clock: GuardClock | None = None

    def read(self, now_ns: int) -> State | None:
        """Read the guard's clock.

        Returns:
            The guard's state; None if no guard has written for a while.
        """
        message = self._maps.clock.read()
        self.clock = None if message is None else GuardClock.unpack(message[1])
        if self.clock is None or now_ns - self.clock.written_ns > ALIVE_NS:
            self.clock = None
            return None
        return STATES[self.clock.state]

    def handover(self, now_ns: int, expected_ns: int) -> Handover | None:
        """Choose parent and instant for a plan that will be ready in ``expected_ns`` [ns]."""
        clock = self.clock
        if clock is None or STATES[clock.state] not in CUED or clock.newest_id == 0:
            return None
        if now_ns - clock.due_ns > max(self._period_ns, STANDS_NS):
            # a plan for an instant guessed from the time that passes would wait for it too long
            return None
        parent = self._plan(clock.newest_id)
        if parent is None:
            return None
        self._learn(clock)
        late = now_ns + expected_ns - clock.due_ns
        slots = max(0, ceil(late / self._period_ns)) + self.lead
        takeover = max(clock.newest_clock + slots * self._period_ns / SECOND, 0.0)
        before = self._plans.get(parent.parent_id)
        if parent.parent_id != parent.plan_id:
            takeover = max(takeover, CLOSEST)
        return Handover(parent, before, takeover)

    def proposed(self, plan: Plan) -> None:
        """Remember a proposal: it may become the next parent."""
        self._plans[plan.plan_id] = plan
        self._proposed_id = plan.plan_id
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

    def _learn(self, clock: GuardClock) -> None:
        """A plan that is not the newest accepted one came too late: aim one slot further."""
        if self._proposed_id == 0:
            return
        if clock.newest_id == self._proposed_id:
            self._missed, self._met = 0, self._met + 1
            if self._met > CONFIDENCE and self.lead:
                self.lead, self._met = self.lead - 1, 0
        else:
            self._missed, self._met = self._missed + 1, 0
            if self._missed >= PATIENCE and self.lead < MOST_LEAD:
                self.lead, self._missed = self.lead + 1, 0
