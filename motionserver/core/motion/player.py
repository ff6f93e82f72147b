"""The player: one plan's clock, the plans that wait for their instant, and the state now."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from motionserver.core.safety.verdict import AcceptedPlan
from motionserver.core.state import PlatformState

MOST_PENDING: Final = 3
"""Accepted plans that may wait; a planner that runs further ahead is refused."""


@dataclass(frozen=True, slots=True)
class Playback:
    """What is played and what follows.

    Attributes:
        playing: The plan in force.
        clock: Its own time [s]; stands still when the loop does.
        pending: Accepted successors, each the child of the one before.
    """

    playing: AcceptedPlan
    clock: float = 0.0
    pending: tuple[AcceptedPlan, ...] = ()

    @property
    def newest(self) -> AcceptedPlan:
        """The plan a proposal must name as its parent."""
        return self.pending[-1] if self.pending else self.playing

    @property
    def newest_clock(self) -> float:
        """Own time of the newest plan [s]; negative while it waits."""
        clock = self.clock
        for accepted in self.pending:
            clock -= accepted.plan.takeover
        return clock

    @property
    def remaining(self) -> float:
        """Time until everything accepted is at rest [s]."""
        return max(0.0, self.newest.plan.duration - self.newest_clock)

    @property
    def is_at_rest(self) -> bool:
        """True when nothing waits and the plan has ended."""
        return not self.pending and self.clock >= self.playing.plan.duration


def advance(playback: Playback, dt: float) -> Playback:
    """Let the clock run by ``dt`` [s]; a waiting plan takes over exactly at its instant."""
    playing, clock, pending = playback.playing, playback.clock + dt, playback.pending
    while pending and clock >= pending[0].plan.takeover:
        clock -= pending[0].plan.takeover
        playing, pending = pending[0], pending[1:]
    return Playback(playing, clock, pending)


def follow(playback: Playback, accepted: AcceptedPlan) -> Playback:
    """Queue a child of the newest plan."""
    return replace(playback, pending=(*playback.pending, accepted))


def state_now(playback: Playback) -> PlatformState:
    """Pose, velocity and acceleration that are played now."""
    return playback.playing.plan.state(playback.clock)
