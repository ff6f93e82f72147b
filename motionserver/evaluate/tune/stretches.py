"""The most eventful stretch of each recording: where a short drive says most."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, fields
from typing import Final

import numpy as np

from motionserver.core.axes import Array
from motionserver.errors import ConfigError
from motionserver.evaluate.recording import Recording

LEAD: Final = 2.0
"""Driven before a stretch but not judged, where there is so much: it begins at neutral [s]."""
_STEP: Final = 0.01


@dataclass(frozen=True, slots=True)
class Stretch:
    """A piece of a recording, its clock set to zero.

    Attributes:
        recording: What is driven, lead included.
        start: First judged instant on the recording's own clock [s].
        end: Last instant on that clock [s].
        lead: Driven before the first judged instant [s].
    """

    recording: Recording
    start: float
    end: float
    lead: float

    @property
    def name(self) -> str:
        """Name of the recording."""
        return self.recording.name

    @property
    def digest(self) -> str:
        """Hash of all that is driven and of where judging begins."""
        text = hashlib.sha256(repr(self.lead).encode())
        for item in fields(self.recording):
            value = getattr(self.recording, item.name)
            if isinstance(value, np.ndarray):
                text.update(f"{item.name}{value.shape}".encode())
                text.update(np.ascontiguousarray(value).tobytes())
            elif item.name != "name":
                text.update(f"{item.name}={value!r}".encode())
        return text.hexdigest()[:16]


def most_eventful(recording: Recording, seconds: float) -> Stretch:
    """The stretch in which the horizontal specific force varies most, the earliest of equals.

    Varies = sum of the variances of f_x and f_y over the stretch, so that a long constant slope
    says nothing and a manoeuvre much.

    Args:
        recording: The drive.
        seconds: Length of the stretch; 0, or at least the whole drive, for all of it.

    Returns:
        The stretch; whole drives have no lead.
    """
    if seconds <= 0.0 or seconds >= recording.duration:
        return Stretch(recording, 0.0, recording.duration, 0.0)
    grid = np.arange(int(recording.duration / _STEP) + 1) * _STEP
    force = np.column_stack(
        [np.interp(grid, recording.times, recording.force[:, i]) for i in (0, 1)]
    )
    count = min(round(seconds / _STEP) + 1, len(grid))
    squares = _sums(force**2, count) / count - (_sums(force, count) / count) ** 2
    # rounded, so that rounding errors of the sums do not decide between equals
    start = round(float(grid[int(np.argmax(np.round(squares.sum(axis=1), 9)))]), 6)
    lead = min(LEAD, start)
    piece = recording.excerpt(start - lead, start + seconds)
    return Stretch(piece, start, round(start + seconds, 6), lead)


def stretches_of(recordings: list[Recording], seconds: float) -> tuple[Stretch, ...]:
    """One stretch of every recording.

    Raises:
        ConfigError: Two recordings have the same name, or there is nothing to hold out.
    """
    names = [recording.name for recording in recordings]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ConfigError(
            "RECORDINGS", f"{', '.join(twice)} given more than once", "Give every drive once."
        )
    if len(names) < 2:
        raise ConfigError(
            "RECORDINGS",
            f"{len(names)} given; to hold one out, two are needed",
            "Give recordings of several drives, the more different the better.",
        )
    return tuple(most_eventful(recording, seconds) for recording in recordings)


def _sums(values: Array, count: int) -> Array:
    """Sums over every window of ``count`` rows."""
    total = np.concatenate((np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)))
    sums: Array = total[count:] - total[:-count]
    return sums
