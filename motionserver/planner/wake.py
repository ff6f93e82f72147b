"""When the planner wakes: once a period, locked to the platform's send slots."""

from __future__ import annotations

from typing import Final

LEAST_PAUSE_NS: Final = 500_000
"""Between the end of a period and the next [ns]."""


def next_wake(first: int, slot: int, due: int, period: int, now: int) -> int:
    """When to wake: on the grid of the send slots, as near to ``due`` as it allows.

    Args:
        first: A wake-up on that grid [ns].
        slot: Spacing of the grid [ns].
        due: One period after the last one [ns].
        period: Of the planner, some slots [ns].
        now: Now [ns]; who is behind skips whole periods, and does not catch up.
    """
    wake = first + -(-(due - slot // 2 - first) // slot) * slot
    behind = now + LEAST_PAUSE_NS - wake
    return wake + max(0, -(-behind // period)) * period
