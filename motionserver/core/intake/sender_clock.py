"""Is a packet late? Judged by arrival spacing against stamp spacing: a sender's clock may be wrong.

A packet can only be late if arrivals paused before it, and what was delayed then arrives closer
together than it was sent. Lateness without such a pause is a clock that drifts or was set: it is
learnt at once, a sudden one from its second packet on. Lateness after a pause that lasts, at the
spacing at which packets are sent, is a longer way or a clock that stood still: it is learnt after
a few packets.
"""

from __future__ import annotations

from typing import Final

from motionserver.core.intake.stamp_rate import StampRate

FOLLOW: Final = 100
"""The least delay may rise by one part in so many of the time that passes (10,000 ppm)."""
FEW: Final = 4
"""Late packets at the spacing of their stamps that prove a delay to be lasting."""


class SenderClock:
    """The offset between one sender's clock and ours, as far as it can be known.

    All instants are integers [ns]; a stamp may be any number, its origin is the sender's own.
    """

    def __init__(self) -> None:
        """Begin without a packet."""
        self._rate = StampRate()
        self.forget()

    def forget(self) -> None:
        """Learn the offset anew from the next packet: the way or the sender is another one."""
        self._last: tuple[int, int] | None = None
        self._least = 0
        self._late = 0
        self._explained = 0
        self._pause: tuple[int, int] | None = None
        self._after_pause = 0
        self._is_doubted = False

    @property
    def complaint(self) -> str:
        """Why the stamps are ignored, in words; empty if they can be used."""
        return self._rate.complaint

    def is_older(self, stamp: int | None) -> bool | None:
        """Whether its stamp says that a packet was sent before the newest one; None if none can."""
        if stamp is None or self._last is None or self.complaint:
            return None
        return stamp < self._last[1]

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
        last, self._last = self._last, (arrival, stamp)
        offset = arrival - stamp
        if last is None or self.complaint:
            self._learn(offset)
            return False
        gap = arrival - last[0]
        self._least = min(self._least + gap // FOLLOW, offset)
        late = offset - self._least
        if gap > 2 * interval:
            # what paused for so long can have held packets back for so long
            self._explained = self._late + gap
            if gap > limit or self._late <= limit:
                self._pause, self._after_pause = (arrival, stamp), 0
        else:
            # the queue behind a pause only gets shorter
            self._explained = min(self._explained, self._late)
        before, self._late = self._late, late
        if late <= limit:
            self._is_doubted = False
            return False
        self._after_pause += 1
        if late > self._explained + interval + limit // 2:
            if late - before > limit and not self._is_doubted:
                # one stamp alone may be a slip of its sender
                self._is_doubted, self._late = True, before
                return True
            self._learn(offset)
            return False
        if self._lasts(arrival, stamp):
            self._learn(offset)
            return False
        return True

    def _lasts(self, arrival: int, stamp: int) -> bool:
        """Whether packets arrive at the spacing at which they are sent, and are late all the same.

        A queue that empties is compressed: it arrives in less time than it was sent in.
        """
        if self._pause is None or self._after_pause < FEW:
            return False
        arrived, sent = arrival - self._pause[0], stamp - self._pause[1]
        return arrived > 0 and 4 * arrived >= 3 * sent

    def _learn(self, offset: int) -> None:
        self._least = offset
        self._late = self._explained = self._after_pause = 0
        self._pause = None
        self._is_doubted = False
