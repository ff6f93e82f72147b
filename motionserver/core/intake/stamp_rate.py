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
        # the former window, if there is one, and the present one
        self._windows: tuple[_Window | None, _Window] | None = None

    def heard(self, arrival: int, stamp: int) -> None:
        """Note a packet that came in order of its sequence [ns]."""
        former, window = self._windows or (None, None)
        if window is None or arrival - window.arrival > 2 * WINDOW_NS + window.arrived:
            # the first one, or the first after a silence that belongs to no window
            self._windows = None, _Window(arrival, stamp)
            return
        window.packets += 1
        window.back += stamp < window.stamp + window.advanced
        window.arrived, window.advanced = arrival - window.arrival, stamp - window.stamp
        if window.arrived >= WINDOW_NS and window.packets >= FEWEST:
            if former is not None:
                self._judge(former, window)
            self._windows = window, _Window(arrival, stamp)

    def _judge(self, former: _Window, window: _Window) -> None:
        good = _is_good(former), _is_good(window)
        if all(good):
            self.complaint = ""
        elif not any(good):
            # a pause and the burst after it balance one another, a clock that was set does not last
            is_balanced = _is_good(former, window)
            # the newer one is all of one kind, even where the older one saw the clock change
            self.complaint = "" if is_balanced else _words(window)


def _rate(*windows: _Window) -> float:
    return sum(one.advanced for one in windows) / sum(one.arrived for one in windows)


def _is_good(*windows: _Window) -> bool:
    is_steady = abs(_rate(*windows) - 1.0) <= TOLERANCE
    return is_steady and sum(one.back for one in windows) < MOST_BACK


def _words(window: _Window) -> str:
    if window.back >= MOST_BACK:
        return f"the sender time went backwards {window.back} times in a second. {_REMEDY}"
    if window.advanced == 0:
        return f"the sender time does not advance, it is {window.stamp} in every packet. {_REMEDY}"
    rate = _rate(window)
    unit = next((name for one, name in _UNITS.items() if 0.5 < rate / one < 2.0), None)
    guess = "." if unit is None else f": is it in {unit}?"
    return f"the sender time runs at {rate:.3g} times the rate of time{guess} {_REMEDY}"
