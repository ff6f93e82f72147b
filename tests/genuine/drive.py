"""Result of a reader, and a converted drive with its proof."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np

from .signals import RATE, Array

GRAVITY: Final = 9.81
"""As the project counts it [m/s^2]."""
LEAST: Final = 0.8
"""Correlation below which a recording is refused."""


class RefusedError(Exception):
    """A recording contradicts physics."""


@dataclass(frozen=True)
class Strapped:
    """Three accelerometers and three gyros in sensor axes of any mounting, and speed.

    `force` is specific force [m/s^2] (+9.81 upwards at rest), `rates` [rad/s] are right-handed
    about the same axes, each row at `t` [s]. Speed has times of its own.
    """

    t: Array
    force: Array
    rates: Array
    speed_t: Array
    speed: Array
    course: Array | None = None
    """Over ground at `speed_t`, counter-clockwise, unwrapped [rad]: tells left from right."""
    delayed_speed: bool = False
    """Speed and course come late by an unknown constant (a GPS receiver's filter)."""
    start: float = 0.0
    end: float = np.inf
    """Stretch that is converted, counted from where sensors and speed are both there [s]."""


@dataclass(frozen=True)
class Planar:
    """Forward and left acceleration [m/s^2], yaw rate [rad/s], speed [m/s] in vehicle axes.

    `sideways` is the lateral speed where the source has it. Roll, pitch and vertical motion are not
    measured.
    """

    t: Array
    forward: Array
    left: Array
    yaw_rate: Array
    speed: Array
    sideways: Array | None = None
    heading: Array | None = None
    """Heading by compass, counter-clockwise [rad], where the source has it."""
    start: float = 0.0
    end: float = np.inf
    """Stretch that is converted [s]."""


@dataclass(frozen=True)
class Proof:
    """Measured against expected below 0.5 Hz: correlation and gain."""

    pairs: dict[str, tuple[float, float]]
    """By what was compared."""
    figures: dict[str, float] = field(default_factory=dict)
    """Further figures by name."""

    def lines(self) -> list[str]:
        """One line per figure."""
        pairs = [f"{name}: {r:.3f}, gain {gain:.2f}" for name, (r, gain) in self.pairs.items()]
        return pairs + [f"{name}: {value:.2f}" for name, value in self.figures.items()]

    def require(self, *names: str, least: float = LEAST) -> None:
        """Refuse a recording that contradicts physics.

        Raises:
            RefusedError: A correlation is too small, or gravity is not 9.81 within 3 %.
        """
        for name in names:
            r, gain = self.pairs[name]
            if not r >= least:
                raise RefusedError(
                    f"{name}: correlation {r:.3f}, gain {gain:.2f}; at least {least} is needed"
                )
        gravity = self.figures.get("gravity m/s^2", GRAVITY)
        if not abs(gravity / GRAVITY - 1.0) <= 0.03:
            raise RefusedError(f"mean specific force is {gravity:.2f} m/s^2, not 9.81 within 3 %")


@dataclass(frozen=True)
class Drive:
    """Rows of the project's recording format at 100 Hz, ISO 8855, SI, and their proof."""

    columns: dict[str, Array]
    proof: Proof

    @property
    def seconds(self) -> float:
        """Length."""
        return len(self.columns["ax"]) / RATE

    def write(self, path: Path) -> None:
        """Write a CSV file that `motion_clients.recording` reads.

        Raises:
            OSError: The file cannot be written.
        """
        decimals = {"ax": 3, "ay": 3, "az": 3, "p": 4, "q": 4, "r": 4, "v": 2}
        names = list(self.columns)
        with path.open("w", encoding="ascii", newline="\n") as file:
            file.write("t," + ",".join(names) + "\n")
            for k, row in enumerate(zip(*self.columns.values(), strict=True)):
                cells = [
                    f"{value:.{decimals.get(name, 4)}f}"
                    for name, value in zip(names, row, strict=True)
                ]
                file.write(f"{k / RATE:.2f}," + ",".join(cells) + "\n")
