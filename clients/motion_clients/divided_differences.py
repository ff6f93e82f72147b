"""Speed, acceleration and jerk of what was commanded, over even or uneven slots of time."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise


def rates(past: Sequence[float], slots: Sequence[int], period: float) -> tuple[float, float, float]:
    """Divided differences of one leg, zero where ``past`` is too short.

    Within acceleration A the mean speeds of two neighbouring steps differ by at most A times the
    time between the middles of the steps, however long each of them is: nothing lawful offends.

    Args:
        past: Positions, newest first [m].
        slots: Slots between ``past[0]`` and ``past[1]``, and so on.
        period: Time of a slot [s].

    Returns:
        Speed [m/s], acceleration [m/s²], jerk [m/s³].
    """
    steps = list(zip(past, past[1:], slots, strict=False))
    times = [count * period for *_, count in steps]
    speeds = [(b - a) / time for (b, a, _), time in zip(steps, times, strict=True)]
    spans = [0.5 * (b + a) for b, a in pairwise(times)]
    bends = [(b - a) / span for (b, a), span in zip(pairwise(speeds), spans, strict=True)]
    jerk = 3.0 * (bends[0] - bends[1]) / sum(times[:3]) if len(bends) > 1 else 0.0
    return speeds[0] if speeds else 0.0, bends[0] if bends else 0.0, jerk


def likeliest_slots(
    legs: Sequence[Sequence[float]],
    slots: Sequence[int],
    most: int,
    period: float,
    speed: float,
    acceleration: float,
) -> int:
    """Slots behind the newest step that make it least offensive, at most ``most``.

    Args:
        legs: Positions of every leg, newest first [m].
        slots: Slots between the positions before the newest.
        most: As many as fit into the gap.
        period: Time of a slot [s].
        speed: Allowed speed [m/s].
        acceleration: Allowed acceleration [m/s²].

    Returns:
        Slots, at least one.
    """

    def offence(count: int) -> float:
        worst = 0.0
        for past in legs:
            fast, bent, _ = rates(past, (count, *slots), period)
            worst = max(worst, abs(fast) / speed, abs(bent) / acceleration)
        return worst

    return min(range(1, max(1, most) + 1), key=offence)
