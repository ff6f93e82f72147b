"""The rival that counts: the classical washout with the gain that suits this recording best."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import wait
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

from motionserver.core.limits import Machine
from motionserver.cueing.tuning import Tuning
from motionserver.evaluate.drive import RATE_HZ, Drive
from motionserver.evaluate.lockstep import PLANNER_HZ, drive
from motionserver.evaluate.metrics.figures import rmse_xy
from motionserver.evaluate.progress import Share
from motionserver.evaluate.recording import Recording
from motionserver.evaluate.worker_pool import worker_pool

COARSE: Final = (0.2, 0.4, 0.6, 0.8, 1.0)
"""Gains tried first."""
STEPS: Final = (0.1, 0.05)
"""Then to both sides of the best."""
MOST_DRIVES: Final = len(COARSE) + 2 * len(STEPS)
"""Drives that a search takes at most."""
_LOOK: Final = 2.0
"""Between two looks at other processes [s]."""
RULE: Final = (
    "classical washout under the same limits and governor, with the gain in (0, 1] of least "
    "RMSE(x, y) on this very recording: tried 0.2, 0.4, 0.6, 0.8, 1.0, then 0.1 and 0.05 to both "
    "sides of the best"
)
"""How the yardstick is chosen, for people."""

Told = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Yardstick:
    """The best scaled classical washout.

    Attributes:
        gain: Its gain [-].
        drive: What it did.
        tried: Every gain tried with its RMSE(x, y), by gain [-, m/s2].
    """

    gain: float
    drive: Drive
    tried: tuple[tuple[float, float], ...]


def find_yardstick(
    machine: Machine,
    recording: Recording,
    tuning: Tuning,
    *,
    rate: float = RATE_HZ,
    planner_hz: float = PLANNER_HZ,
    jobs: int = 1,
    tell: Told | None = None,
    progress: Share | None = None,
) -> Yardstick:
    """Search the gain; the result does not depend on ``jobs``.

    Args:
        machine: Geometry and hard limits.
        recording: The drive.
        tuning: Scale and thresholds; algorithm and gain are replaced.
        rate: Rate of the executed samples [Hz].
        planner_hz: Planner rate [Hz].
        jobs: Processes that drive at the same time.
        tell: Called with a line for every round of gains.
        progress: Called with the share done.

    Returns:
        The yardstick.
    """
    run = partial(_drive, machine, recording, tuning, rate, planner_hz)
    tried: dict[float, float] = {}
    best: Drive | None = None
    best_gain = 0.0
    for step in (0.0, *STEPS):
        asked = COARSE if step == 0.0 else (best_gain - step, best_gain + step)
        gains = tuple(g for g in (round(a, 6) for a in asked) if 0.0 < g <= 1.0 and g not in tried)
        done = len(tried)

        def share(part: float, done: int = done) -> None:
            if progress is not None:
                progress(min(1.0, (done + part) / MOST_DRIVES))

        for gain, driven in zip(gains, _all(run, gains, jobs, share), strict=True):
            tried[gain] = rmse_xy(driven)
            # a tie goes to the smaller gain, whatever the order of trial
            if best is None or (tried[gain], gain) < (tried[best_gain], best_gain):
                best, best_gain = driven, gain
        if tell is not None and gains:
            tell(f"yardstick: gain {best_gain:g}, RMSE(x, y) {tried[best_gain]:.4f} m/s2")
    assert best is not None
    return Yardstick(best_gain, replace(best, name="yardstick"), tuple(sorted(tried.items())))


def yardstick_of(
    machine: Machine,
    recording: Recording,
    tuning: Tuning,
    gain: float,
    *,
    rate: float = RATE_HZ,
    planner_hz: float = PLANNER_HZ,
) -> Yardstick:
    """The yardstick whose gain was found before, driven again; see `find_yardstick`."""
    driven = _drive(machine, recording, tuning, rate, planner_hz, gain)
    return Yardstick(gain, replace(driven, name="yardstick"), ((gain, rmse_xy(driven)),))


def _all(
    run: Callable[..., Drive], gains: tuple[float, ...], jobs: int, share: Share
) -> list[Drive]:
    """Drives of all gains; ``share`` is told how many are done, as a number of drives."""
    if jobs <= 1 or len(gains) < 2:
        return [
            run(gain, progress=lambda part, k=k: share(k + part)) for k, gain in enumerate(gains)
        ]
    with worker_pool(min(jobs, len(gains))) as pool:
        futures = [pool.submit(run, gain) for gain in gains]
        running = set(futures)
        while running:
            running = wait(running, timeout=_LOOK).not_done
            share(len(futures) - len(running))
        return [future.result() for future in futures]


def _drive(
    machine: Machine,
    recording: Recording,
    tuning: Tuning,
    rate: float,
    planner_hz: float,
    gain: float,
    progress: Share | None = None,
) -> Drive:
    washout = replace(tuning, algorithm="classical", gain=gain)
    return drive(machine, recording, washout, rate=rate, planner_hz=planner_hz, progress=progress)
