"""When the guard ticks and when it sends: an even grid, and never two packets close together.

A setpoint holds one send period of motion. If a late packet were followed by the next one on an
unmoved grid, both would reach the platform within a fraction of a period: the legs would be asked
for a multiple of the speed that was checked, and a platform that reads once per frame would skip a
word. A late packet therefore moves the grid. The plan's clock counts packets, so it simply pauses.
"""

from __future__ import annotations

from math import ceil
from typing import Final

CLOSEST: Final = 0.85
"""Least time between two packets, as a share of the send period: small lateness does not move the
grid, so that the mean rate stays nominal."""
_ROUNDING: Final = 1e-3
"""Share of a tick by which a wake-up counts as on the grid."""


class SendGrid:
    """Instants of ticks and packets on CLOCK_MONOTONIC.

    Args:
        tick_ns: Time between two ticks [ns].
        ticks_per_send: Ticks between two packets.
        now_ns: Now [ns]; the first packet is due a tick later.
    """

    def __init__(self, tick_ns: float, ticks_per_send: int, now_ns: int) -> None:
        self._tick_ns = tick_ns
        self._send_ns = tick_ns * ticks_per_send
        self._closest_ns = CLOSEST * self._send_ns
        self._due_ns = now_ns + tick_ns

    @property
    def due_ns(self) -> int:
        """When the next packet is due [ns]."""
        return ceil(self._due_ns)

    def resume(self, due_ns: int, sent_ns: int, now_ns: int) -> None:
        """Go on in the rhythm of another guard.

        Args:
            due_ns: When its next packet was due [ns].
            sent_ns: When its last packet had been sent at the latest [ns].
            now_ns: Now [ns].
        """
        due = max(float(due_ns), sent_ns + self._closest_ns)
        # whatever was left behind, the platform is not kept waiting longer than a period
        self._due_ns = min(due, now_ns + self._send_ns)

    def first_tick(self, now_ns: int) -> int:
        """When to tick first: at once if a packet is overdue [ns]."""
        return max(self.due_ns, now_ns) if self.is_due(now_ns) else self.next_tick(now_ns)

    def next_tick(self, now_ns: int) -> int:
        """The next instant of the grid after ``now_ns`` [ns]."""
        ticks_before = ceil((self._due_ns - now_ns) / self._tick_ns - _ROUNDING) - 1
        return ceil(self._due_ns - ticks_before * self._tick_ns)

    def is_due(self, now_ns: int) -> bool:
        """True once a packet is due."""
        return now_ns >= self.due_ns

    def expected_due(self, now_ns: int) -> int:
        """When the packet after one that is sent now will be due [ns]."""
        return ceil(max(self._after(now_ns), now_ns + self._closest_ns))

    def take(self, now_ns: int) -> int:
        """Use the slot that is due.

        Returns:
            Whole slots that passed unused before it.
        """
        missed = int((now_ns - self._due_ns) // self._send_ns)
        self._due_ns = self._after(now_ns)
        return max(0, missed)

    def keep_apart(self, sent_ns: int) -> None:
        """Let the next packet be no closer to the one sent at ``sent_ns`` [ns] than allowed."""
        self._due_ns = max(self._due_ns, sent_ns + self._closest_ns)

    def _after(self, now_ns: int) -> float:
        """The slot after the one that is due, or after ``now_ns`` if that is later."""
        passed = max(0, int((now_ns - self._due_ns) // self._send_ns))
        return self._due_ns + (passed + 1) * self._send_ns
