"""What a base was sent, in the order it came, and what the pauses in it hid."""

import struct
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from motion_clients.moog_wire import Mcw
from motion_clients.motion_log import read_motion_log

PERIOD = 1.0 / 60.0
"""Nominal time between two packets [s]."""
STEP = 1.05 * 0.5 * PERIOD
"""A leg makes at most so much way from one packet to the next [m]: 0.5 m/s at 60 Hz."""
ACCELERATION = 8.0 + 2e-3
"""What the judge allows a leg [m/s²]."""
CLOSEST = 0.8
"""Packets are never closer [send periods]."""
WALL_SPEED = 1.25 * 0.5
"""A leg is never asked for more in wall time [m/s]: 0.5 m/s are the machine's."""
MOVING = 0.05
"""Slower than this the length of a step says nothing about its time [m/s]."""


@dataclass(frozen=True, slots=True)
class Stretch:
    """Neighbouring setpoints.

    Attributes:
        at: Their instants, (N,) [ns].
        words: What they say, (N, 6) [m].
    """

    at: np.ndarray
    words: np.ndarray


@dataclass(frozen=True, slots=True)
class Crossing:
    """One pause, and the motion over it.

    Attributes:
        pause: Its length in send periods.
        speed: Largest leg speed about it [m/s].
        acceleration: Largest leg acceleration over it, as if there had been no pause [m/s²].
        jerk: Largest leg jerk likewise [m/s³].
        periods: How many send periods of motion the step over it holds, measured with the steps
            beside it; nan where the platform hardly moves.
    """

    pause: float
    speed: float
    acceleration: float
    jerk: float
    periods: float


def stretches(log: Path) -> list[Stretch]:
    """All setpoints, parted where another command stands between them."""
    found: list[list[tuple[int, tuple[float, ...]]]] = [[]]
    for at, data in read_motion_log(log):
        mcw, *words = struct.unpack(">I6fI", data)
        if mcw & 0xFF == Mcw.NEW_POSITION:
            found[-1].append((at, tuple(words[:6])))
        elif found[-1]:
            found.append([])
    return [
        Stretch(np.array([at for at, _ in one], np.int64), np.array([words for _, words in one]))
        for one in found
        if one
    ]


def pauses(log: Path) -> list[float]:
    """Times between neighbouring setpoints, sorted, in send periods."""
    gaps = [1e-9 * np.diff(one.at) / PERIOD for one in stretches(log)]
    return sorted(float(gap) for gap in np.concatenate(gaps))


def spacings(log: Path) -> list[float]:
    """Times between neighbouring packets of any kind, sorted, in send periods.

    By the kernel's stamps, where the base that wrote the log has them.
    """
    instants = [at for at, _ in read_motion_log(log)]
    return sorted(1e-9 * (b - a) / PERIOD for a, b in pairwise(instants))


def wall_speeds(log: Path) -> list[float]:
    """Largest leg speed of each step in wall time, by the instants of arrival, sorted [m/s]."""
    found: list[float] = []
    for one in stretches(log):
        times = 1e-9 * np.diff(one.at)
        found += (np.abs(np.diff(one.words, axis=0)).max(axis=1) / times).tolist()
    return sorted(found)


def assert_apart(log: Path) -> None:
    """No two packets within a fraction of a period, and no leg faster than allowed for it."""
    assert spacings(log)[0] >= CLOSEST
    assert wall_speeds(log)[-1] <= WALL_SPEED


def largest_step(log: Path) -> float:
    """Largest difference of a word between two setpoints, whatever was sent between them [m]."""
    words = np.concatenate([one.words for one in stretches(log)])
    return float(max(np.abs(b - a).max() for a, b in pairwise(words)))


def crossing(every: list[Stretch], instant: int) -> Crossing:
    """The longest pause that begins about ``instant`` [ns], where a sender was killed or stopped.

    The packet before may still have been under way.
    """
    one = next(s for s in every if s.at[0] < instant and instant < s.at[-1] + 10**9)
    k = int(np.searchsorted(one.at, instant)) - 1
    first = max(2, k - 1)
    gaps = np.diff(one.at)[first : k + 3]
    k = first + int(np.argmax(gaps))
    about = one.words[k - 2 : k + 4]
    steps = np.diff(about, axis=0)
    before, over, after = steps[1:4]
    usual = 0.5 * (before + after)
    speed = float(np.abs(usual).max() / PERIOD)
    periods = float(over @ usual / (usual @ usual)) if speed > MOVING else float("nan")
    return Crossing(
        pause=float(1e-9 * gaps.max() / PERIOD),
        speed=speed,
        acceleration=float(np.abs(np.diff(steps[1:4], axis=0)).max() / PERIOD**2),
        jerk=float(np.abs(np.diff(steps, n=2, axis=0)).max() / PERIOD**3),
        periods=periods,
    )


def periods_of_motion(log: Path) -> list[float]:
    """How many send periods of motion each step holds, by its neighbours, where a leg moves.

    One, but for what the platform accelerates; nothing for a sample sent twice, two for a step over
    a sample left out.
    """
    told: list[float] = []
    for one in stretches(log):
        steps = np.diff(one.words, axis=0)
        usual = 0.5 * (steps[:-2] + steps[2:])
        moving = np.abs(usual).max(axis=1, initial=0.0) > MOVING * PERIOD
        over = np.sum(steps[1:-1] * usual, axis=1)[moving]
        told += (over / np.sum(usual * usual, axis=1)[moving]).tolist()
    return told


def spread(values: list[float]) -> dict[str, float]:
    """A distribution in five figures."""
    known = np.array([v for v in values if v == v])
    if not len(known):
        return {}
    marks = {"min": 0, "p50": 50, "p90": 90, "p99": 99, "max": 100}
    return {name: round(float(np.percentile(known, at)), 4) for name, at in marks.items()}
