"""Recorded drives as arrays; `motion_clients.recording` reads the files."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from motion_clients import recording as files

from motionserver.core.axes import Array, frozen
from motionserver.core.kinematics.rotation import gravity_in_body
from motionserver.errors import MotionServerError

COLUMNS = files.COLUMNS
"""Columns of a recording, in any order."""


class RecordingError(MotionServerError):
    """A recording cannot be read; tells file, line (from 1) and column.

    Attributes:
        line: Line in the file; None if it is the file as a whole.
        column: Name of the column; None if it is the line as a whole.
    """

    def __init__(self, text: str, line: int | None = None, column: str | None = None) -> None:
        super().__init__(text)
        self.line = line
        self.column = column


@dataclass(frozen=True, slots=True)
class Recording:
    """A whole drive, its clock beginning at zero.

    Attributes:
        name: File name without its ending.
        times: Instants, increasing from 0, (N,) [s].
        force: Specific force at the sent point, gravity included, (N, 3) [m/s2].
        rates: Body rates, (N, 3) [rad/s].
        speed: Forward speed, (N,) [m/s].
        warnings: What looks wrong in its file, one line each with the likely slip.
    """

    name: str
    times: Array
    force: Array
    rates: Array
    speed: Array
    warnings: tuple[str, ...] = ()

    @property
    def duration(self) -> float:
        """Instant of the last sample [s]."""
        return float(self.times[-1])

    def excerpt(self, start: float, end: float) -> Recording:
        """The samples from ``start`` to ``end`` [s], the clock set to zero again.

        Raises:
            ValueError: Fewer than two samples are left.
        """
        kept = (self.times >= start - 1e-9) & (self.times <= end + 1e-9)
        if int(kept.sum()) < 2:
            raise ValueError(
                f"recording {self.name}: fewer than two samples between {start:g} s and {end:g} s; "
                f"it lasts from 0 s to {self.duration:g} s"
            )
        return from_samples(
            self.name, self.times[kept], self.force[kept], self.rates[kept], self.speed[kept]
        )


def from_samples(name: str, times: Array, force: Array, rates: Array, speed: Array) -> Recording:
    """A recording of arrays as described there; the clock is set to zero."""
    return Recording(name, frozen(times - times[0]), frozen(force), frozen(rates), frozen(speed))


def read_recording(path: str | Path) -> Recording:
    """Read a CSV file, see `motion_clients.recording`.

    Args:
        path: The file.

    Returns:
        The drive.

    Raises:
        RecordingError: The file cannot be read; file, line and column are named.
    """
    try:
        read = files.read_recording(path)
    except files.RecordingError as error:
        raise RecordingError(str(error), error.line, error.column) from error
    samples = read.samples
    roll, pitch = np.array([sample.attitude for sample in samples]).T
    drive = from_samples(
        read.path.stem,
        np.array([sample.time for sample in samples]),
        np.array([sample.acceleration for sample in samples]) + gravity_in_body(roll, pitch),
        np.array([sample.rates for sample in samples]),
        np.array([sample.speed for sample in samples]),
    )
    return replace(drive, warnings=read.warnings)
