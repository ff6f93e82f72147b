"""The hardest rival: a washout whose gain and corners suit this very recording best."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from motionserver.core.limits import Machine
from motionserver.cueing.classical import REID_NAHON, Classical
from motionserver.cueing.think import Thinker
from motionserver.cueing.tuning import Tuning
from motionserver.evaluate.drive import RATE_HZ, Drive
from motionserver.evaluate.lockstep import PLANNER_HZ, drive
from motionserver.evaluate.metrics.figures import rmse_xy
from motionserver.evaluate.metrics.workspace import workspace_figures
from motionserver.evaluate.progress import Share
from motionserver.evaluate.recording import Recording
from motionserver.evaluate.screen import Screen, Washout
from motionserver.evaluate.yardstick import Yardstick, find_yardstick

HIGHS: Final = (1.5, 4.0, 9.0)
"""High-pass corners of surge and sway [rad/s].

Of five times five corners, 1.5 2.5 4 6 9 x 1 2 4 8 12, these three times three contain the best
on each of the shipped recordings.
"""
LOWS: Final = (2.0, 4.0, 12.0)
"""Low-pass corners of tilt coordination [rad/s]."""
GAINS: Final = (0.1, 0.25, 0.4, 0.55, 0.7, 0.85, 1.0)
DRIVEN: Final = 3
"""How many of the screen's best are driven through the server."""
_INSPECTED: Final = 12
_SCREENING: Final = 0.3
"""Share of the time that the screen takes, about."""
HINDSIGHT_RULE: Final = (
    "classical washout with gain and corners chosen on this very recording: surge and sway "
    f"high-pass {', '.join(f'{h:g}' for h in HIGHS)} x tilt low-pass "
    f"{', '.join(f'{low:g}' for low in LOWS)} rad/s x gain {', '.join(f'{g:g}' for g in GAINS)}, "
    "screened as filters alone (no planner, no latency, tilt rate limited in the loop, sets that "
    "leave a leg's limits left out), the three best and the yardstick also driven through the "
    "server with its governor; the better of all counts"
)
"""How it is chosen, for people."""

Told = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Trial:
    """One set that was tried.

    Attributes:
        washout: Corners and gain.
        rmse: RMSE of x and y together [m/s2].
        inside: True if no leg left its limits.
    """

    washout: Washout
    rmse: float
    inside: bool


@dataclass(frozen=True, slots=True)
class Hindsight:
    """The better of screen and server.

    Attributes:
        washout: Corners and gain that count.
        by_server: True if the server's drive counts, False if the screen's.
        drive: What it does.
        screened: All sets, the best inside first.
        driven: The screen's best through the server, in the same order, then the yardstick.
        best_screen: RMSE of the screen's best that breaks no limit; None if all do [m/s2].
    """

    washout: Washout
    by_server: bool
    drive: Drive
    screened: tuple[Trial, ...]
    driven: tuple[Trial, ...]
    best_screen: float | None

    @property
    def best_server(self) -> float:
        """RMSE of the best drive through the server [m/s2]."""
        return min(trial.rmse for trial in self.driven)

    def described(self) -> str:
        """What won and what both ways gave, in one line."""
        screen = "none inside" if self.best_screen is None else f"{self.best_screen:.4f}"
        return (
            f"high-pass {self.washout.high:g} rad/s, low-pass {self.washout.low:g} rad/s, gain "
            f"{self.washout.gain:g}; RMSE(x, y) of the screen {screen}, of the server "
            f"{self.best_server:.4f} m/s2; the {'server' if self.by_server else 'screen'} counts"
        )


def find_hindsight(
    machine: Machine,
    recording: Recording,
    tuning: Tuning,
    *,
    rate: float = RATE_HZ,
    planner_hz: float = PLANNER_HZ,
    yardstick: Yardstick | None = None,
    tell: Told | None = None,
    progress: Share | None = None,
) -> Hindsight:
    """Search corners and gain; whatever the yardstick may choose from is among the choices.

    The yardstick's grid of gains is finer than that of the screen, and the governor makes something
    of sets that the screen leaves out, so its best can be the best of all.

    Args:
        machine: Geometry, hard limits and head point.
        recording: The drive.
        tuning: Scale and thresholds; algorithm, gain and filters are replaced.
        rate: Rate of the executed samples [Hz].
        planner_hz: Planner rate of the server's drives [Hz].
        yardstick: That of this recording, tuning and rates; searched if None.
        tell: Called with a line for the result.
        progress: Called with the share done.

    Returns:
        The best of all.
    """
    if yardstick is None:
        yardstick = find_yardstick(machine, recording, tuning, rate=rate, planner_hz=planner_hz)
    share = (lambda done: None) if progress is None else progress
    share(0.0)
    screen = Screen(machine, recording, tuning, HIGHS, LOWS, GAINS)
    sets = [Washout(h, low, g) for h in HIGHS for low in LOWS for g in GAINS]
    trials = []
    for number, washout in enumerate(sets):
        share(_SCREENING * number / len(sets))
        trials.append(Trial(washout, *screen.judge(washout)))
    # if nothing is inside, the governor may still make something of the smallest gains
    trials.sort(key=lambda t: (not t.inside, t.rmse if t.inside else t.washout.gain, t.rmse))
    shown = _first_inside(screen, trials, rate)
    best = None if shown is None else rmse_xy(shown[1])
    washouts = [trial.washout for trial in trials[:DRIVEN]]
    each = (1.0 - _SCREENING) / len(washouts)
    drives = [
        _through_server(
            machine,
            recording,
            tuning,
            washout,
            rate,
            planner_hz,
            lambda part, k=k: share(_SCREENING + each * (k + part)),  # type: ignore[misc]
        )
        for k, washout in enumerate(washouts)
    ]
    washouts.append(_standard(yardstick.gain))
    drives.append(yardstick.drive)
    driven = tuple(
        Trial(washout, rmse_xy(made), True) for washout, made in zip(washouts, drives, strict=True)
    )
    winner = int(np.argmin([trial.rmse for trial in driven]))
    if shown is None or driven[winner].rmse <= rmse_xy(shown[1]):
        washout, made, by_server = driven[winner].washout, drives[winner], True
    else:
        (washout, made), by_server = shown, False
    found = Hindsight(
        washout, by_server, replace(made, name="hindsight"), tuple(trials), driven, best
    )
    if tell is not None:
        tell(f"hindsight: {found.described()}")
    return found


def _standard(gain: float) -> Washout:
    """The yardstick's corners with this gain."""
    return Washout(REID_NAHON.high.omega, REID_NAHON.low.omega, gain)


def _first_inside(screen: Screen, trials: list[Trial], rate: float) -> tuple[Washout, Drive] | None:
    """The best set of the screen that breaks no limit at the rate of judging."""
    for trial in trials[:_INSPECTED]:
        if not trial.inside:
            break
        made = screen.drive(trial.washout, rate)
        if workspace_figures(made.machine, made.pose, made.legs, 1.0 / rate).violations == 0:
            return trial.washout, made
    return None


def _through_server(
    machine: Machine,
    recording: Recording,
    tuning: Tuning,
    washout: Washout,
    rate: float,
    planner_hz: float,
    progress: Share,
) -> Drive:
    chosen = replace(tuning, algorithm=Classical.name, gain=washout.gain)
    thinker = Thinker(machine, chosen, 1.0 / planner_hz, machine.parked_pose[None])
    thinker.cueing = Classical(machine, chosen, 1.0 / planner_hz, washout.filters())
    return drive(
        machine,
        recording,
        chosen,
        rate=rate,
        planner_hz=planner_hz,
        thinker=thinker,
        progress=progress,
    )
