"""A network link that loses, delays, doubles and reorders datagrams, the same way every time."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from random import Random


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkFlaws:
    """What is wrong with a link.

    Attributes:
        loss: Probability that a datagram vanishes.
        duplicate: Probability that it arrives twice.
        reorder: Probability that it is held back by ``reorder_delay``, so that others overtake.
        delay: Constant delay [s].
        jitter: Greatest further delay, uniformly distributed [s].
        reorder_delay: How long a datagram held back waits [s].
        silent_from: Instant from which nothing passes [s].
        silent_until: Instant from which it passes again [s].
    """

    loss: float = 0.0
    duplicate: float = 0.0
    reorder: float = 0.0
    delay: float = 0.0
    jitter: float = 0.0
    reorder_delay: float = 0.025
    silent_from: float = inf
    silent_until: float = inf

    def __post_init__(self) -> None:
        """Refuse what is no probability or no duration."""
        for name in ("loss", "duplicate", "reorder"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"link {name} {getattr(self, name)}: a probability is within 0..1")
        for name in ("delay", "jitter", "reorder_delay"):
            if not 0.0 <= getattr(self, name) < inf:
                raise ValueError(f"link {name} {getattr(self, name)} s: must be 0 or more")


class FlawedLink:
    """One direction of a link; pure, with a random generator of its own.

    Attributes:
        flaws: What is wrong with it now; may be replaced at any time.
        lost: Datagrams that vanished.
    """

    def __init__(self, flaws: LinkFlaws | None = None, *, seed: int = 0) -> None:
        """A link.

        Args:
            flaws: What is wrong with it; by default nothing.
            seed: Of the random generator.
        """
        self.flaws = LinkFlaws() if flaws is None else flaws
        self.lost = 0
        self._random = Random(seed)

    def delays(self, now: float) -> tuple[float, ...]:
        """After what times [s] a datagram sent at ``now`` [s] arrives: never, once or twice."""
        flaws, draw = self.flaws, self._random.random
        if flaws.silent_from <= now < flaws.silent_until or draw() < flaws.loss:
            self.lost += 1
            return ()
        copies = 2 if draw() < flaws.duplicate else 1
        return tuple(
            flaws.delay
            + flaws.jitter * draw()
            + (flaws.reorder_delay if draw() < flaws.reorder else 0.0)
            for _ in range(copies)
        )
