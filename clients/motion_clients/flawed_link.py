"""A network link that loses, delays, doubles, reorders and damages datagrams, always the same way.

The n-th datagram of a link takes the same number of draws whatever happens to it, so its fate in
one respect does not depend on the other flaws: more loss loses the same datagrams and further
ones, and a silence changes nothing that comes after it.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from random import Random
from typing import Final

MOST_FLIPPED: Final = 8
"""Bits flipped in a corrupted datagram: one to so many."""

_PROBABILITIES: Final = ("loss", "duplicate", "reorder", "corrupt", "truncate")
_DURATIONS: Final = ("delay", "jitter", "reorder_delay")


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkFlaws:
    """What is wrong with a link.

    Attributes:
        loss: Probability that a datagram vanishes.
        duplicate: Probability that it arrives twice.
        reorder: Probability that it is held back by ``reorder_delay``, so that others overtake.
        corrupt: Probability that one to :data:`MOST_FLIPPED` of its bits are flipped.
        truncate: Probability that only its beginning arrives, at least one byte less.
        delay: Constant delay [s].
        jitter: Greatest further delay, uniformly distributed [s].
        reorder_delay: How long a datagram held back waits [s].
        silences: Times during which nothing enters the link, each from (included) until
            (excluded) [s].
    """

    loss: float = 0.0
    duplicate: float = 0.0
    reorder: float = 0.0
    corrupt: float = 0.0
    truncate: float = 0.0
    delay: float = 0.0
    jitter: float = 0.0
    reorder_delay: float = 0.025
    silences: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        """Refuse what is no probability, no duration or no stretch of time."""
        for name in _PROBABILITIES:
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"link {name} {getattr(self, name)}: a probability is within 0..1")
        for name in _DURATIONS:
            if not 0.0 <= getattr(self, name) < inf:
                raise ValueError(f"link {name} {getattr(self, name)} s: must be 0 or more")
        for begin, end in self.silences:
            if not begin < end:
                raise ValueError(f"link silences {begin}..{end} s: must end after it begins")

    def is_silent(self, now: float) -> bool:
        """Whether nothing enters the link at ``now`` [s]."""
        return any(begin <= now < end for begin, end in self.silences)


@dataclass(frozen=True, slots=True)
class Arrival:
    """One copy of a datagram at the far end.

    Attributes:
        delay: How long after it was sent it arrives [s].
        datagram: Its bytes then.
    """

    delay: float
    datagram: bytes


@dataclass(slots=True)
class LinkCounts:
    """What happened on a link.

    Attributes:
        received: Datagrams that were sent into it.
        lost: Datagrams that vanished, those of a silence among them.
        silenced: Datagrams that vanished in a silence.
        duplicated: Datagrams that arrive twice.
        reordered: Copies held back.
        corrupted: Copies with flipped bits.
        truncated: Copies cut short.
        changed: Copies that are not what was sent, by either.
    """

    received: int = 0
    lost: int = 0
    silenced: int = 0
    duplicated: int = 0
    reordered: int = 0
    corrupted: int = 0
    truncated: int = 0
    changed: int = 0


class FlawedLink:
    """One direction of a link; pure, with a random generator of its own.

    Attributes:
        counts: What happened so far.
        flaws: What is wrong with it now; may be replaced at any time.
    """

    def __init__(
        self,
        flaws: LinkFlaws | None = None,
        *,
        seed: int = 0,
        counts: LinkCounts | None = None,
    ) -> None:
        """A link.

        Args:
            flaws: What is wrong with it; by default nothing.
            seed: Of the random generator.
            counts: Where to count; by default the link's own.
        """
        self.flaws = LinkFlaws() if flaws is None else flaws
        self.counts = LinkCounts() if counts is None else counts
        self._random = Random(seed)

    @property
    def lost(self) -> int:
        """Datagrams that vanished."""
        return self.counts.lost

    def carry(self, now: float, datagram: bytes) -> tuple[Arrival, ...]:
        """What becomes of a datagram sent at ``now`` [s]: it arrives never, once or twice.

        Instants must be of one clock, that of ``LinkFlaws.silences``.
        """
        flaws, counts, draw = self.flaws, self.counts, self._random.random
        counts.received += 1
        is_lost, is_doubled = draw() < flaws.loss, draw() < flaws.duplicate
        first, second = self._copy(datagram), self._copy(datagram)
        is_silent = flaws.is_silent(now)
        if is_silent or is_lost:
            counts.lost += 1
            counts.silenced += is_silent
            return ()
        copies = (first, second) if is_doubled else (first,)
        counts.duplicated += is_doubled
        return tuple(self._arrive(datagram, copy) for copy in copies)

    def _copy(self, datagram: bytes) -> _Copy:
        """Draw what becomes of one copy; always as many draws."""
        flaws, draw = self.flaws, self._random.random
        return _Copy(
            delay=flaws.delay + flaws.jitter * draw(),
            is_reordered=draw() < flaws.reorder,
            is_corrupted=draw() < flaws.corrupt,
            is_truncated=draw() < flaws.truncate,
            kept=int(draw() * len(datagram)),
            damage=self._random.getrandbits(32),
        )

    def _arrive(self, datagram: bytes, copy: _Copy) -> Arrival:
        arrived = datagram[: copy.kept] if copy.is_truncated else datagram
        counts = self.counts
        counts.truncated += len(arrived) < len(datagram)
        if copy.is_corrupted and arrived:
            arrived = _flipped(arrived, copy.damage)
            counts.corrupted += 1
        counts.changed += arrived != datagram
        counts.reordered += copy.is_reordered
        held_back = self.flaws.reorder_delay if copy.is_reordered else 0.0
        return Arrival(copy.delay + held_back, arrived)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Copy:
    """What was drawn for a copy: bytes ``kept`` if truncated, seed of the ``damage`` if corrupt."""

    delay: float
    is_reordered: bool
    is_corrupted: bool
    is_truncated: bool
    kept: int
    damage: int


def _flipped(datagram: bytes, damage: int) -> bytes:
    """The datagram with some of its bits flipped, different ones, so that none is flipped back."""
    dice = Random(damage)
    bits = 8 * len(datagram)
    mask = sum(1 << bit for bit in dice.sample(range(bits), dice.randint(1, MOST_FLIPPED)))
    return (int.from_bytes(datagram, "big") ^ mask).to_bytes(len(datagram), "big")
