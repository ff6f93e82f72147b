"""How far each signed session was heard, so that a recording of it moves nothing later."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import islice
from typing import Final

MOST: Final = 4096
"""Sessions that are remembered; the one not heard for longest is forgotten first."""
FAR: Final = 1 << 24
"""A sequence so far beyond the mark is a slip of its sender unless others go on from it."""
FEW: Final = 3
"""Packets in a row that must go on from it."""
NEAR: Final = 16
"""How far apart these may be."""
JUMPED: Final = 1 << 32
"""What `Sessions.hear` returns for such a packet: beyond every sequence."""
OVER: Final = 0xFFFFFFFF
"""Mark of a session of which nothing is believed any more."""


class Sessions:
    """The highest sequence heard of each signed session, whether it was believed or not.

    A signature proves who wrote a packet, not when. Only who has the key makes new packets, and
    those of one session count upwards; so whatever is at or below the mark was on the wire before.
    Packets that were refused for another reason raise the mark too: they could be recorded as well.

    One number that is far ahead would end its session; it does not raise the mark, and is not used.
    Who recorded it cannot use it either: only several in a row are, and those raise the mark.

    Args:
        marks: Sessions and their marks, the one heard last at the end.
    """

    def __init__(self, marks: Iterable[tuple[int, int]] = ()) -> None:
        self._marks = dict(marks)
        self._here: set[int] = set()
        self._far: dict[int, tuple[int, int]] = {}
        self._shrink()

    def __len__(self) -> int:
        return len(self._marks)

    def is_new(self, session: int) -> bool:
        """Whether nothing was heard of this session since this process began."""
        return session not in self._here

    def hear(self, session: int, sequence: int) -> int:
        """Take note of a packet.

        Args:
            session: Of a packet whose signature is right.
            sequence: Of the same packet. A session ends before its sequence wraps.

        Returns:
            The mark before it, -1 without any. A packet at or below may be a recording. `JUMPED`
            for a sequence far ahead that nothing confirms yet.
        """
        mark = self._marks.pop(session, -1)
        jumped = mark >= 0 and sequence - mark > FAR and not self._goes_on(session, sequence)
        self._marks[session] = mark if jumped else max(mark, sequence)
        self._here.add(session)
        self._shrink()
        return JUMPED if jumped else mark

    def _goes_on(self, session: int, sequence: int) -> bool:
        at, count = self._far.get(session, (-1, 0))
        count = count + 1 if 0 < sequence - at <= NEAR else 1
        self._far[session] = (sequence, count)
        return count >= FEW

    def newest(self, count: int) -> list[tuple[int, int]]:
        """The ``count`` sessions heard last with their marks, the last one at the end."""
        return list(islice(reversed(self._marks.items()), count))[::-1]

    def marks(self, *, may_go_on: bool) -> list[tuple[int, int]]:
        """All sessions with their marks, to be kept.

        Args:
            may_go_on: True if nothing will be heard after this. Else what was heard here may be
                heard further, and of that nothing shall be believed if this is what is left.
        """
        if may_go_on:
            return list(self._marks.items())
        return [(one, OVER if one in self._here else mark) for one, mark in self._marks.items()]

    def _shrink(self) -> None:
        while len(self._marks) > MOST:
            oldest = next(iter(self._marks))
            del self._marks[oldest]
            self._here.discard(oldest)
            self._far.pop(oldest, None)
