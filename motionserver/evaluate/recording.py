"""Recorded drives as arrays; `motion_clients.recording` reads the files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from motion_clients import recording as files

from motionserver.core.axes import Array, frozen
from motionserver.core.kinematics.rotation import gravity_in_body, transfer
from motionserver.core.state import DriveMode, Driver, Preview
from motionserver.errors import MotionServerError
from motionserver.evaluate.live import Live, NotDrivenError, live_of

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
        modes: What the simulator was doing, N of them; None if it drove all the time.
        drivers: What the driver did, N of them, None where untold; None if it never was told.
        previews: What the sender told ahead, N of them, None where untold; None if it never did.
        live: How the server drove it, from the first sample on; None if it was not recorded so.
    """

    name: str
    times: Array
    force: Array
    rates: Array
    speed: Array
    warnings: tuple[str, ...] = ()
    modes: tuple[DriveMode, ...] | None = None
    drivers: tuple[Driver | None, ...] | None = None
    previews: tuple[Preview | None, ...] | None = None
    live: Live | None = None

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
        first, last = (int(k) for k in np.flatnonzero(kept)[[0, -1]])
        rows = slice(first, last + 1)
        return replace(
            self,
            times=frozen(self.times[rows] - self.times[first]),
            force=frozen(self.force[rows]),
            rates=frozen(self.rates[rows]),
            speed=frozen(self.speed[rows]),
            modes=None if self.modes is None else self.modes[rows],
            drivers=None if self.drivers is None else self.drivers[rows],
            previews=None if self.previews is None else self.previews[rows],
            # its beginning is no longer that of the live drive, which faded in
            live=self.live if first == 0 else None,
        )


def from_samples(name: str, times: Array, force: Array, rates: Array, speed: Array) -> Recording:
    """A recording of arrays as described there; the clock is set to zero."""
    return Recording(name, frozen(times - times[0]), frozen(force), frozen(rates), frozen(speed))


def read_recording(path: str | Path) -> Recording:
    """Read a CSV file, see `motion_clients.recording`.

    Of a file that `motionserver record` wrote it is what was heard while the platform was driven:
    the longest stretch in RUN, at the head point as it was live.

    Args:
        path: The file.

    Returns:
        The drive.

    Raises:
        RecordingError: The file cannot be read; file, line and column are named.
    """
    try:
        read = files.read_recording(path)
        live = live_of(read)
    except files.RecordingError as error:
        raise RecordingError(str(error), error.line, error.column) from error
    except NotDrivenError as error:
        raise RecordingError(f"{path}: {error}") from error
    whole = _arrays(read)
    if live is None:
        return whole
    start = read.samples[0].time
    try:
        driven = whole.excerpt(live.begin - start, live.end - start)
    except ValueError as error:
        raise RecordingError(f"{path}: nothing was heard while the platform was driven") from error
    warnings = (*whole.warnings, *live.remarks)
    return replace(_at_head(driven, live.arm), warnings=warnings, live=live)


def _arrays(read: files.Recording) -> Recording:
    samples = read.samples
    roll, pitch = np.array([sample.attitude for sample in samples]).T
    gravity = gravity_in_body(roll, pitch)
    recording = from_samples(
        read.path.stem,
        np.array([sample.time for sample in samples]),
        np.array([sample.acceleration for sample in samples]) + gravity,
        np.array([sample.rates for sample in samples]),
        np.array([sample.speed for sample in samples]),
    )
    modes = tuple(DriveMode(int(sample.mode)) for sample in samples)
    drivers = tuple(_driver(sample) for sample in samples)
    previews = tuple(_preview(s, g) for s, g in zip(samples, gravity, strict=True))
    return replace(
        recording,
        warnings=read.warnings,
        modes=modes if any(mode is not DriveMode.DRIVE for mode in modes) else None,
        drivers=drivers if any(drivers) else None,
        previews=previews if any(one is not None for one in previews) else None,
    )


def _driver(sample: files.RecordedSample) -> Driver | None:
    told = sample.driver
    if told is None:
        return None
    return Driver(told.throttle, told.brake, told.clutch, told.steering, told.gear)


def _preview(sample: files.RecordedSample, gravity: Array) -> Preview | None:
    if not sample.preview:
        return None
    return Preview(
        frozen([one.time for one in sample.preview]),
        frozen(np.array([one.acceleration for one in sample.preview]) + gravity),
        frozen([one.rates for one in sample.preview]),
    )


def _at_head(recording: Recording, arm: Array) -> Recording:
    """The same drive at the driver's head, where it was wanted live."""
    if not np.any(arm):
        return recording
    spin = np.gradient(recording.rates, recording.times, axis=0)
    previews = recording.previews
    if previews is not None:
        previews = tuple(None if one is None else _moved(one, arm) for one in previews)
    force = transfer(recording.force, recording.rates, spin, arm)
    return replace(recording, force=frozen(force), previews=previews)


def _moved(preview: Preview, arm: Array) -> Preview:
    spin = np.zeros_like(preview.rates)
    if len(preview.times) > 1:
        spin = np.gradient(preview.rates, preview.times, axis=0)
    return replace(preview, force=frozen(transfer(preview.force, preview.rates, spin, arm)))


def read_all(recordings: Sequence[str | Path | Recording]) -> list[Recording]:
    """Read those that are files.

    Raises:
        RecordingError: A file cannot be read.
    """
    return [r if isinstance(r, Recording) else read_recording(r) for r in recordings]
