"""What a judge of a Moog base looks at: the base, and the limits of what it may be asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from .hexapod_legs import Six
from .moog_wire import CommandMode, MachineState


class SeenDevice(Protocol):
    """What the judge looks at of the base it stands beside."""

    @property
    def mode(self) -> CommandMode:
        """Command mode in force."""
        ...

    @property
    def state(self) -> MachineState:
        """Machine state."""
        ...

    @property
    def target(self) -> Six:
        """Leg extensions the drives are told to reach, six [m]."""
        ...

    @property
    def transitions(self) -> Sequence[tuple[float, MachineState]]:
        """Every state entered, with its instant [s]."""
        ...

    @property
    def is_at_rest(self) -> bool:
        """Whether the base stands."""
        ...

    @property
    def is_parked(self) -> bool:
        """Whether the base is down and stands."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class JudgedLimits:
    """What a leg may be asked for.

    Attributes:
        speed: Leg speed [m/s].
        acceleration: Leg acceleration [m/s²].
        jerk: Leg jerk [m/s³]; None records it without judging.
        period: Nominal time between two commands [s].
        may_lose: Whether the wire loses commands, so that a gap excuses a step of that long, and
            delays them, so that their spacing is not the sender's.
        spacing: Least time between two commands, as a share of ``period``; closer ones are counted.
        hiding: Closer than this share of ``period``, a command is an offence where the legs move: a
            base that reads once a frame may not see it. Between the two lies what a network may do.
        wall_speed: Leg speed in wall time, as a multiple of ``speed``.
        in_wall_time: Whether the instants of arrival are exact enough to be judged; else they are
            only recorded.
    """

    speed: float = 0.6
    acceleration: float = 8.0
    jerk: float | None = None
    period: float = 1 / 60
    may_lose: bool = False
    spacing: float = 0.8
    hiding: float = 0.5
    wall_speed: float = 1.25
    in_wall_time: bool = True
