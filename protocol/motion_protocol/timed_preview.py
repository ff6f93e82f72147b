"""A preview whose samples have instants of their own: close together first, further apart later."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import isfinite
from typing import Final

from .blocks import PREVIEW_MAX, SAMPLE, Sample, check_length, check_samples, pack_samples
from .errors import BlockLengthError, FieldError, UnknownValueError
from .layout import Layout, not_finite

TIMED_PREVIEW: Final = 4
TIMED_PREVIEW_MINOR: Final = 1
"""Minor version that brought this block."""
TIMED_PREVIEW_LAYOUT: Final = Layout("timed_preview", (("count", "H"), ("", "2x")))
LATEST: Final = 40_000
"""Latest instant of a sample [units of `UNIT`]: 4 s."""
UNIT: Final = 1e-4
"""What instants are counted in on the wire [s]."""
CLOSE_STEP: Final = 0.01
"""Spacing of the first samples that `preview_times` chooses [s]."""
CLOSE_COUNT: Final = 20
"""How many samples are spaced so: 0.2 s."""
_TIME_SIZE: Final = 2


@dataclass(frozen=True, slots=True)
class TimedPreview:
    """What the sender expects the vehicle to do next, at instants of its own choice.

    Attributes:
        times: Instant of each sample after the cue's own simulation time, increasing, 0 to 4 s;
            rounded to 0.1 ms [s].
        samples: As many tuples (ax, ay, az [m/s^2], p, q, r [rad/s]), 1 to 40, with or without
            gravity as the cue's flag says.
    """

    times: tuple[float, ...]
    samples: tuple[Sample, ...]


def preview_times(horizon: float) -> tuple[float, ...]:
    """Choose the instants of a preview that reaches ``horizon`` [s] and fits into a packet.

    Every 10 ms for the first 0.2 s, and as long as that suffices; then what is left of the 40
    samples at equal distances up to the horizon.

    Args:
        horizon: How far to look ahead, 0 to 4 [s].

    Returns:
        At most 40 instants [s]; none if the horizon is shorter than 10 ms.

    Raises:
        ValueError: The horizon is out of range.
    """
    if not 0.0 <= horizon <= LATEST * UNIT:
        raise ValueError(f"preview of {horizon:g} s: give a time from 0 to {LATEST * UNIT:g} s")
    fits = int(horizon / CLOSE_STEP + 1e-6)
    close = tuple(CLOSE_STEP * step for step in range(1, fits + 1))
    if fits <= PREVIEW_MAX:
        return close
    near = CLOSE_STEP * CLOSE_COUNT
    step = (horizon - near) / (PREVIEW_MAX - CLOSE_COUNT)
    far = (near + step * number for number in range(1, PREVIEW_MAX - CLOSE_COUNT + 1))
    return close[:CLOSE_COUNT] + tuple(far)


def pack_timed_preview(preview: TimedPreview) -> bytes:
    """Write the body of the timed preview block."""
    samples, times = preview.samples, preview.times
    if len(samples) != len(times):
        raise FieldError(
            f"timed_preview has {len(times)} times and {len(samples)} samples; "
            f"give one time for each sample",
            field="timed_preview.times",
        )
    body = pack_samples(samples, "timed_preview")
    for index, time in enumerate(times):
        if not isfinite(time):
            raise not_finite(f"timed_preview.times[{index}]", time)
    # what is far outside may be too large to be counted in units
    units = [round(min(max(time, -1.0), 2.0 * LATEST * UNIT) / UNIT) for time in times]
    complaint = _complaint(units, times)
    if complaint:
        raise FieldError(f"timed_preview.times: {complaint}", field="timed_preview.times")
    head = TIMED_PREVIEW_LAYOUT.pack(len(samples))
    return head + body + b"".join(unit.to_bytes(_TIME_SIZE, "little") for unit in units)


def unpack_timed_preview(data: bytes, offset: int, length: int) -> TimedPreview:
    """Read the body of the timed preview block."""
    head = TIMED_PREVIEW_LAYOUT.size
    if length < head:
        check_length(TIMED_PREVIEW_LAYOUT, offset, length, head)
    (count,) = TIMED_PREVIEW_LAYOUT.unpack(data, offset)
    if not 1 <= count <= PREVIEW_MAX:
        raise BlockLengthError(
            f"timed_preview.count at byte {offset} is {count}; allowed are 1 to {PREVIEW_MAX}; "
            f"leave the block out where nothing is known",
            field="timed_preview.count",
        )
    check_length(TIMED_PREVIEW_LAYOUT, offset, length, head + count * (SAMPLE.size + _TIME_SIZE))
    first, last = offset + head, offset + head + count * SAMPLE.size
    samples = tuple(SAMPLE.iter_unpack(data[first:last]))
    check_samples(samples, "timed_preview")
    units = [
        int.from_bytes(data[at : at + _TIME_SIZE], "little")
        for at in range(last, offset + length, _TIME_SIZE)
    ]
    times = tuple(unit * UNIT for unit in units)
    complaint = _complaint(units, times)
    if complaint:
        raise UnknownValueError(
            f"timed_preview.times at byte {last}: {complaint}", field="timed_preview.times"
        )
    return TimedPreview(times, samples)


def _complaint(units: list[int], times: tuple[float, ...]) -> str | None:
    """What is wrong with instants, in units of `UNIT` and in seconds; None if nothing is."""
    allowed = f"allowed are increasing times from 0 to {LATEST * UNIT:g} s, 0.1 ms apart at least"
    for index, unit in enumerate(units):
        if not 0 <= unit <= LATEST:
            return f"sample {index} is at {times[index]:.6g} s; {allowed}"
    for index, (before, unit) in enumerate(pairwise(units), 1):
        if unit <= before:
            return (
                f"sample {index} at {times[index]:.6g} s does not come after the one before it at "
                f"{times[index - 1]:.6g} s; {allowed}"
            )
    return None
