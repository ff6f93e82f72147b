"""How far long work has come and how long it will still take, always visible on standard error."""

from __future__ import annotations

import sys
from collections.abc import Callable
from time import monotonic
from typing import Final, TextIO

Share = Callable[[float], None]
"""Called with the share of some part of the work that is done, 0..1."""
WEIGHTS: Final = {"mpc": 2.5, "thondel2014": 2.0}
"""How long a drive takes beside one of the classical washout, about; others as that."""
_EVERY: Final = 10.0
"""Between two lines where nobody looks at a terminal [s]."""
_EVERY_ON_TERMINAL: Final = 0.5
_SOONEST: Final = 1.0
"""A rate measured over less says nothing [s]."""
_LEAST: Final = 0.002
"""Nor one measured over a smaller share of the work."""


class Progress:
    """Tells the share done and the time left: a line that renews itself, or lines in a file.

    Args:
        name: Of the work, at the beginning of every line.
        total: Size of the work in any unit.
        stream: Where to tell; None for standard error.
        clock: Steady time [s].
        quiet: True to say nothing.
    """

    def __init__(
        self,
        name: str,
        total: float,
        stream: TextIO | None = None,
        clock: Callable[[], float] = monotonic,
        quiet: bool = False,
    ) -> None:
        self._name, self._total = name, max(total, 1e-9)
        self._stream = sys.stderr if stream is None else stream
        self._clock, self._quiet = clock, quiet
        self._is_terminal = self._stream.isatty()
        self._begun = self._changed = clock()
        self._done = 0.0
        self._shown: float | None = None
        self._has_estimate = False
        self._width = 0
        self._what = ""

    def at(self, done: float, what: str = "") -> None:
        """Tell that ``done`` of the total is done; ``what`` is being done now."""
        now = self._clock()
        if done > self._done:
            self._done, self._changed = min(done, self._total), now
        begins = what != self._what
        self._what = what or self._what
        left = self._left(now)
        pause = _EVERY_ON_TERMINAL if self._is_terminal else _EVERY
        is_due = self._shown is None or now - self._shown >= pause
        if (
            is_due
            or (begins and self._is_terminal)
            or (left is not None and not self._has_estimate)
        ):
            self._show(now, left)

    def part(self, begin: float, size: float, what: str) -> Share:
        """Tells of a part of the work that begins at ``begin`` and has this size."""

        def tell(share: float) -> None:
            self.at(begin + size * share, what)

        tell(0.0)
        return tell

    def line(self, text: str) -> None:
        """Say something that stays."""
        if not self._quiet:
            self._clear()
            self._stream.write(f"{self._name}: {text}\n")
            self._stream.flush()

    def close(self) -> None:
        """Leave the line."""
        if not self._quiet:
            self._clear()
            self._stream.flush()

    def _left(self, now: float) -> float | None:
        """Time until all is done, by the rate until now [s]; None while that says nothing."""
        elapsed = self._changed - self._begun
        if elapsed < _SOONEST or self._done < _LEAST * self._total:
            return None
        whole = elapsed / self._done * (self._total - self._done)
        return max(0.0, whole - (now - self._changed))

    def _show(self, now: float, left: float | None) -> None:
        if self._quiet:
            return
        self._shown = now
        self._has_estimate = left is not None
        time = "time left is being measured" if left is None else f"about {spoken(left)} left"
        text = f"{self._name}: {100.0 * self._done / self._total:.0f} % done, {time}"
        text += f": {self._what}" if self._what else ""
        if self._is_terminal:
            self._stream.write("\r" + text.ljust(self._width))
            self._width = len(text)
        else:
            self._stream.write(text + "\n")
        self._stream.flush()

    def _clear(self) -> None:
        if self._is_terminal and self._width:
            self._stream.write("\r" + " " * self._width + "\r")
            self._width = 0


def spoken(seconds: float) -> str:
    """A duration for people."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    minutes, rest = divmod(whole, 60)
    if minutes < 60:
        return f"{minutes} min {rest:02d} s"
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min"
