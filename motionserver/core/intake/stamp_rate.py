"""Does a sender's stamp advance as time does? If not, it is named in words and not used."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from motionserver.core.intake.freshness import SECOND_NS

WINDOW_NS: Final = SECOND_NS
"""Length of what is judged at a time [ns]."""
FEWEST: Final = 4
"""Packets in a window below which it is longer."""
TOLERANCE: Final = 0.2
"""Deviation of the rate from 1 that jitter of arrivals can cause within a window [-]."""
MOST_BACK: Final = 3
"""Steps backwards in a window that make a stamp useless; a clock that is set makes one."""
_UNITS: Final = {1e-3: "microseconds", 1e-6: "milliseconds", 1e-9: "seconds", 1e3: "picoseconds"}
_REMEDY: Final = (
    "It must be the sender's monotonic clock in nanoseconds. It is ignored, packets are used as "
    "they arrive: delayed ones cannot be told from others."
)


@dataclass(slots=True)
class _Window:
    """Arrivals and stamps from one packet to another."""

    arrival: int
    stamp: int
    packets: int = 0
    back: int = 0
    arrived: int = 0
    advanced: int = 0


class StampRate:
    """Judges the stamps of one sender, a window at a time; two in a row decide.

    Attributes:
        complaint: What is wrong with the stamps, and what to do; empty if they can be used.
    """

    def __init__(self) -> None:
        """Begin without a packet."""
        self.complaint = ""
        self._window: _Window | None = None
        self._former: _Window | None = None
        self._newest = 0

    def heard(self, arrival: int, stamp: int) -> None:
        """Note a packet that came in order of its sequence [ns]."""
        window = self._window
        if window is None or arrival - window.arrival > 2 * WINDOW_NS + window.arrived:
            # the first one, or the first after a silence that belongs to no window
            self._window, self._former, self._newest = _Window(arrival, stamp), None, stamp
            return
        window.packets += 1
        window.back += stamp < self._newest
        window.arrived, window.advanced = arrival - window.arrival, stamp - window.stamp
        self._newest = stamp
        if window.arrived >= WINDOW_NS and window.packets >= FEWEST:
            self._judge(window)
            self._window, self._former = _Window(arrival, stamp), window

    def _judge(self, window: _Window) -> None:
        former = self._former
        if former is None:
            return
        if _is_good(window) and _is_good(former):
            self.complaint = ""
        elif not _is_good(window) and not _is_good(former):
            # a pause and the burst after it balance one another, a clock that was set does not last
            both = _Window(
                former.arrival,
                former.stamp,
                former.packets + window.packets,
                former.back + window.back,
                former.arrived + window.arrived,
                former.advanced + window.advanced,
            )
            # the newer one is all of one kind, even where the older one saw the clock change
            self.complaint = "" if _is_good(both) else _words(window, self._newest)


def _rate(window: _Window) -> float:
    return window.advanced / window.arrived


def _is_good(window: _Window) -> bool:
    return abs(_rate(window) - 1.0) <= TOLERANCE and window.back < MOST_BACK


def _words(window: _Window, stamp: int) -> str:
    if window.back >= MOST_BACK:
        return f"the sender time went backwards {window.back} times in a second. {_REMEDY}"
    if window.advanced == 0:
        return f"the sender time does not advance, it is {stamp} in every packet. {_REMEDY}"
    rate = _rate(window)
    unit = next((name for one, name in _UNITS.items() if 0.5 < rate / one < 2.0), None)
    guess = "" if unit is None else f": is it in {unit}?"
    return f"the sender time runs at {rate:.3g} times the rate of time{guess or '.'} {_REMEDY}"
