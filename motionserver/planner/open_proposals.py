"""Proposals that the guard has not decided about yet."""

from __future__ import annotations

from collections import deque
from typing import Final

from motionserver.core.plan import Plan
from motionserver.telemetry.link import GuardClock
from motionserver.telemetry.ticker import SLOWEST_TICK_HZ

READ_NS: Final = int(2 * 10**9 / SLOWEST_TICK_HZ)
"""A guard that ticks has read a proposal after this time [ns]."""


class OpenProposals:
    """Remembers proposals, oldest first, until there is a verdict.

    Args:
        patience_ns: After this time without a verdict a proposal counts as lost: another guard
            may have taken over, which does not read what was proposed to the one before [ns].
    """

    def __init__(self, patience_ns: int) -> None:
        self._patience_ns = patience_ns
        self._waiting: deque[tuple[Plan, int]] = deque()

    def add(self, plan: Plan, now_ns: int) -> None:
        """Note a proposal; one that does not continue those before replaces them."""
        if self._waiting and plan.parent_id != self._waiting[-1][0].plan_id:
            self._waiting.clear()
        self._waiting.append((plan, now_ns))

    def forget(self, clock: GuardClock, now_ns: int) -> None:
        """Drop what was decided about or is lost."""
        for _ in range(self._decided(clock)):
            self._waiting.popleft()
        while self._waiting and now_ns - self._waiting[0][1] > self._patience_ns:
            self._waiting.popleft()

    def _decided(self, clock: GuardClock) -> int:
        """How many of the oldest the guard is done with."""
        done = (clock.judged_id, clock.newest_id)
        numbers = range(len(self._waiting), 0, -1)
        return next((n for n in numbers if self._waiting[n - 1][0].plan_id in done), 0)

    @property
    def newest(self) -> Plan | None:
        """The newest proposal without a verdict."""
        return self._waiting[-1][0] if self._waiting else None

    @property
    def proposed_ns(self) -> int:
        """When that one was proposed [ns]."""
        return self._waiting[-1][1]

    @property
    def are_too_many(self) -> bool:
        """True once one is checked and one waits for its check: a third would replace it."""
        return len(self._waiting) > 1

    def would_overwrite(self, plan: Plan, clock: GuardClock, now_ns: int) -> bool:
        """Whether ``plan`` continues a proposal that the guard has not even read."""
        if not self._waiting or self._waiting[-1][0].plan_id != plan.parent_id:
            return False
        parent, proposed_ns = self._waiting[-1]
        is_read = parent.plan_id in (clock.taken_id, clock.judged_id)
        return not is_read and now_ns - proposed_ns < READ_NS
