"""A recorded drive in memory: its samples, and what was noted beside them."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from pathlib import Path

from motion_protocol import DriverInputs, Mode, Vector3


@dataclass(frozen=True, slots=True)
class PreviewSample:
    """One instant of what was expected to come.

    Attributes:
        time: After the sample it came with [s].
        acceleration: Kinematic acceleration x, y, z, with that sample's attitude [m/s^2].
        rates: Body rates p, q, r [rad/s].
    """

    time: float
    acceleration: Vector3
    rates: Vector3


@dataclass(frozen=True, slots=True)
class RecordedSample:
    """One instant of a recording, ISO 8855 body axes.

    Attributes:
        time: Since whatever the recording counts from [s].
        acceleration: Kinematic acceleration x, y, z, gravity removed [m/s^2].
        rates: Body rates p, q, r [rad/s].
        speed: Forward speed [m/s].
        attitude: Roll (positive left side up), pitch (positive nose down) [rad].
        mode: What the simulator was doing.
        driver: What the driver did, if it is told.
        preview: What was expected to come; empty if it is not told.
        sender_time: The sender's own clock [s], if it is told.
        sim_time: The simulation's own time [s], if it is told.
    """

    time: float
    acceleration: Vector3
    rates: Vector3
    speed: float
    attitude: tuple[float, float]
    mode: Mode = Mode.DRIVE
    driver: DriverInputs | None = None
    preview: tuple[PreviewSample, ...] = ()
    sender_time: float | None = None
    sim_time: float | None = None


@dataclass(frozen=True, slots=True)
class Recording:
    """A whole drive.

    Attributes:
        path: The file it came from.
        samples: At least two, their times strictly increasing.
        warnings: What looks wrong in it, one line each with the likely slip.
        states: Of the server's own recordings: time and motion state at each change.
        settings: Of the server's own recordings: time and settings (JSON) at each change.
    """

    path: Path
    samples: tuple[RecordedSample, ...]
    warnings: tuple[str, ...] = ()
    states: tuple[tuple[float, str], ...] = ()
    settings: tuple[tuple[float, str], ...] = ()

    @property
    def duration(self) -> float:
        """From the first to the last sample [s]."""
        return self.samples[-1].time - self.samples[0].time

    @property
    def period(self) -> float:
        """Mean spacing of the samples [s]."""
        return self.duration / (len(self.samples) - 1)

    def index_at(self, time: float) -> int:
        """Index of the last sample not later than `time` [s], of the first if none is."""
        return max(0, bisect_right(self.samples, time, key=_time_of) - 1)

    def values_at(self, time: float) -> tuple[float, float, float, float, float, float]:
        """Acceleration and rates at `time` [s], on the straight line between two samples."""
        index = min(self.index_at(time), len(self.samples) - 2)
        before, after = self.samples[index], self.samples[index + 1]
        share = (time - before.time) / (after.time - before.time)
        share = min(max(share, 0.0), 1.0)
        ax, ay, az, p, q, r = (
            a + share * (b - a)
            for a, b in zip(
                (*before.acceleration, *before.rates),
                (*after.acceleration, *after.rates),
                strict=True,
            )
        )
        return ax, ay, az, p, q, r


def _time_of(sample: RecordedSample) -> float:
    return sample.time
