"""When a packet was sent, by our clock: the recorder's time base for what the vehicle did.

Arrivals are those of the planner's looks at its socket, some milliseconds late and two packets at
once; the sender's own clock is even. So the time of a packet is its sender's, moved by the least
delay from there to here that was seen; without a sender's clock it is the arrival.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from typing import Final

from motionserver.core.state import VehicleMotion

ENOUGH_NS: Final = 400_000_000
"""The least delay is known after so much of a drive [ns]."""
_TOLERANCE_NS: Final = 5_000_000
"""The sender's clock may drift so far until the delay is taken anew [ns]."""
_WINDOW: Final = 200
_STEP_NS: Final = 1_000
"""Least distance of two packets: their times must increase [ns]."""


class CueClock:
    """Gives times to packets, holding back the first ones of a sender until its delay is known.

    Args:
        before: Packets of a while ago, from which delays are known at once.
    """

    def __init__(self, before: Iterable[VehicleMotion] = ()) -> None:
        self._session: int | None = None
        self._delay: int | None = None
        self._delays: deque[int] = deque(maxlen=_WINDOW)
        self._held: list[VehicleMotion] = []
        self._last = -(1 << 62)
        for _ in self.timed(before):
            pass
        self.flush()
        self._last = -(1 << 62)

    def timed(self, packets: Iterable[VehicleMotion]) -> list[tuple[int, VehicleMotion]]:
        """Take packets; those whose time is known now, with it [ns], in order."""
        out: list[tuple[int, VehicleMotion]] = []
        for packet in packets:
            if packet.session != self._session:
                out += self.flush()
                self._session, self._delay = packet.session, None
                self._delays.clear()
            if packet.sender_ns is None:
                out.append((self._after(packet.arrival_ns), packet))
                continue
            self._delays.append(packet.arrival_ns - packet.sender_ns)
            if self._delay is None:
                self._held.append(packet)
                if packet.arrival_ns - self._held[0].arrival_ns >= ENOUGH_NS:
                    out += self.flush()
                continue
            self._follow(self._delays[-1])
            out.append((self._after(packet.sender_ns + self._delay), packet))
        return out

    def flush(self) -> list[tuple[int, VehicleMotion]]:
        """Give out what is held back, by the least delay seen until now."""
        held, self._held = self._held, []
        if not held:
            return []
        self._delay = min(self._delays)
        return [(self._after((p.sender_ns or 0) + self._delay), p) for p in held]

    def _follow(self, delay: int) -> None:
        assert self._delay is not None
        least = min(self._delays) if len(self._delays) == _WINDOW else self._delay
        if delay < self._delay - _TOLERANCE_NS or least > self._delay + _TOLERANCE_NS:
            self._delay = min(self._delays)

    def _after(self, time_ns: int) -> int:
        self._last = max(time_ns, self._last + _STEP_NS)
        return self._last
