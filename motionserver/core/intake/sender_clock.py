"""Is a packet late? Judged by arrival spacing against stamp spacing: a sender's clock may be wrong.

A packet can only be late if arrivals paused before it, and what was delayed then arrives closer
together than it was sent. Lateness without such a pause is a clock that drifts or was set: it is
learnt at once, a sudden one from its second packet on. Lateness after a pause that lasts, at the
spacing at which packets are sent, is a longer way or a clock that stood still: it is learnt after
a few packets.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from motionserver.core.intake.stamp_rate import StampRate

FOLLOW: Final = 100
"""The least delay may rise by one part in so many of the time that passes (10,000 ppm)."""
FEW: Final = 4
"""Late packets at the spacing of their stamps that prove a delay to be lasting."""


@dataclass(slots=True)
class _Pause:
    """The packet that ended a pause of the arrivals, and how many were late since."""

    arrival: int
    stamp: int
    late: int = 0


class _Delay:
    """The least delay on one way by one clock, learnt from its first packet [ns]."""

    def __init__(self, arrival: int, stamp: int) -> None:
        self._arrival, self.stamp = arrival, stamp
        self._least = arrival - stamp
        self._late = self._explained = 0
        self._pause: _Pause | None = None
        self._is_doubted = False

    def judge(self, arrival: int, stamp: int, interval: int, limit: int) -> bool | None:
        """Whether a packet is late; None if it shows that the delay is another one from here on."""
        gap = arrival - self._arrival
        self._arrival, self.stamp = arrival, stamp
        offset = arrival - stamp
        self._least = min(self._least + gap // FOLLOW, offset)
        late = offset - self._least
        if gap > 2 * interval:
            # what paused for so long can have held packets back for so long
            self._explained = self._late + gap
            if gap > limit or self._late <= limit:
                self._pause = _Pause(arrival, stamp)
        else:
            # the queue behind a pause only gets shorter
            self._explained = min(self._explained, self._late)
        before, self._late = self._late, late
        if late <= limit:
            self._is_doubted = False
            return False
        if self._pause is not None:
            self._pause.late += 1
        if 2 * (late - self._explained - interval) > limit:
            if late - before > limit and not self._is_doubted:
                # one stamp alone may be a slip of its sender
                self._is_doubted, self._late = True, before
                return True
            return None
        return None if self._lasts(arrival, stamp) else True

    def _lasts(self, arrival: int, stamp: int) -> bool:
        """Whether packets arrive at the spacing at which they are sent, and are late all the same.

        A queue that empties is compressed: it arrives in less time than it was sent in.
        """
        pause = self._pause
        if pause is None or pause.late < FEW:
            return False
        arrived, sent = arrival - pause.arrival, stamp - pause.stamp
        return arrived > 0 and 4 * arrived >= 3 * sent


class SenderClock:
    """The offset between one sender's clock and ours, as far as it can be known.

    All instants are integers [ns]; a stamp may be any number, its origin is the sender's own.
    """

    def __init__(self) -> None:
        """Begin without a packet."""
        self._rate = StampRate()
        self._delay: _Delay | None = None

    def forget(self) -> None:
        """Learn the offset anew from the next packet: the way or the sender is another one."""
        self._delay = None

    @property
    def complaint(self) -> str:
        """Why the stamps are ignored, in words; empty if they can be used."""
        return self._rate.complaint

    def is_older(self, stamp: int | None) -> bool | None:
        """Whether its stamp says that a packet was sent before the newest one; None if none can."""
        if stamp is None or self._delay is None or self.complaint:
            return None
        return stamp < self._delay.stamp

    def is_late(self, arrival: int, stamp: int, interval: int, limit: int) -> bool:
        """Note a packet in order of its sequence, and judge it.

        Args:
            arrival: When it arrived here.
            stamp: When it was sent, in the sender's clock.
            interval: Usual time between two arrivals.
            limit: Delay beyond the least one that is borne.

        Returns:
            True if it was really delayed by more than the limit.
        """
        self._rate.heard(arrival, stamp)
        is_late = None
        if self._delay is not None and not self.complaint:
            is_late = self._delay.judge(arrival, stamp, interval, limit)
        if is_late is None:
            self._delay = _Delay(arrival, stamp)
        return bool(is_late)
