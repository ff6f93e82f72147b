"""Which packet comes after which: small gaps are losses, a jump must be confirmed by what follows.

One number far away, ahead or behind, is refused and changes nothing. If the packets after it go on
from there, and none from where the stream was, the sender counts anew: then that is the stream.
"""

from __future__ import annotations

from typing import Final

FEW: Final = 3
"""Packets in a row that go on from a jump before it is taken for the stream."""
ALWAYS_AHEAD: Final = 16
"""A gap of so many numbers is always a loss; of more if the time that passed can explain it."""
REORDERED: Final = 32
"""Without a stamp that tells old from new, so far behind a packet is always a late one."""
MOST_MISSING: Final = 1024
"""Numbers that did not come and are waited for, so that late ones are not counted as lost."""
_WORLD: Final = 1 << 32


class SequenceOrder:
    """The order of one sender's packets, modulo 2^32.

    Attributes:
        lost: Sequence numbers that never came.
        is_restart: True if the newest packet in order began a count anew, behind the former one.
    """

    def __init__(self) -> None:
        """Begin without a packet."""
        self.lost = 0
        self.is_restart = False
        self.forget()

    def forget(self) -> None:
        """Take whatever number comes next as the first one; what was lost stays counted."""
        self._newest: int | None = None
        self._missing: dict[int, None] = {}
        self._jump: tuple[int, int] | None = None

    def judge(self, sequence: int | None, expected: float, is_older: bool | None) -> str | None:
        """Note a packet that arrived, whatever else becomes of it.

        Args:
            sequence: Its number; None if its format has none.
            expected: Packets that can have been sent since the newest one.
            is_older: Whether its stamp says that it was sent before the newest one; None if there
                is no stamp that can be used.

        Returns:
            None if it comes next, else "replayed", "reordered" (behind) or "jumped" (far ahead).
        """
        self.is_restart = False
        if sequence is None or self._newest is None:
            self._newest = sequence
            return None
        ahead = (sequence - self._newest) % _WORLD
        if ahead == 0:
            return "replayed"
        if ahead <= ALWAYS_AHEAD + expected:
            self._skip(self._newest, ahead)
            self._newest, self._jump = sequence, None
            return None
        behind = _WORLD - ahead
        is_behind = behind <= 1 << 31
        was_missing = sequence in self._missing
        if was_missing:
            del self._missing[sequence]
            self.lost -= 1
        if was_missing and is_older is not False:
            return "reordered"
        if is_behind and (is_older or (is_older is None and behind <= REORDERED)):
            return "reordered"
        if self._goes_on(sequence):
            self.is_restart = is_behind
            self._newest, self._jump = sequence, None
            self._missing.clear()
            return None
        return "reordered" if is_behind else "jumped"

    def _skip(self, newest: int, ahead: int) -> None:
        self.lost += ahead - 1
        for step in range(max(1, ahead - MOST_MISSING), ahead):
            self._missing[(newest + step) % _WORLD] = None
        while len(self._missing) > MOST_MISSING:
            del self._missing[next(iter(self._missing))]

    def _goes_on(self, sequence: int) -> bool:
        """Whether enough packets in a row have followed a jump; note this one."""
        count = 1
        if self._jump is not None:
            at, before = self._jump
            if sequence == at:
                return False
            if (sequence - at) % _WORLD <= ALWAYS_AHEAD:
                count += before
        self._jump = (sequence, count)
        return count >= FEW
