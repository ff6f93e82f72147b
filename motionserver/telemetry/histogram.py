"""A fixed histogram of durations: percentiles of millions of ticks without keeping one of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil
from typing import Final

_UNIT_BITS: Final = 6
"""The finest bin is 64 ns wide."""
_STEPS: Final = 16
"""Bins per octave: a bin is at most 1/16 of its value wide, so percentiles err by some 3 %."""
_OCTAVES: Final = 25
BINS: Final = (_OCTAVES + 1) * _STEPS
"""From 0 to 34 s; what is longer counts as 34 s."""


class Histogram:
    """Counts durations [ns] in bins that grow with their value."""

    def __init__(self, counts: Sequence[int] | None = None) -> None:
        self.counts = [0] * BINS if counts is None else list(counts)

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, int]) -> Histogram:
        """Read what `to_mapping` wrote."""
        out = cls()
        for index, count in mapping.items():
            out.counts[int(index)] = count
        return out

    def to_mapping(self) -> dict[str, int]:
        """Bins that are not empty, by their number, for JSON."""
        return {str(index): count for index, count in enumerate(self.counts) if count}

    def add(self, value_ns: int) -> None:
        """Count one duration; a negative one counts as zero."""
        self.counts[bin_of(value_ns)] += 1

    def since(self, earlier: Histogram) -> Histogram:
        """What was counted after ``earlier`` was taken of the same histogram."""
        return Histogram([a - b for a, b in zip(self.counts, earlier.counts, strict=True)])

    def plus(self, other: Histogram) -> Histogram:
        """Both together."""
        return Histogram([a + b for a, b in zip(self.counts, other.counts, strict=True)])

    @property
    def total(self) -> int:
        """How many were counted."""
        return sum(self.counts)

    def percentile(self, share: float) -> float:
        """The smallest value that at least ``share`` (0..1) of the counted do not exceed [ns].

        It is the middle of a bin: right to within 1/32 of itself. 0 when nothing was counted.
        """
        rank = max(1, ceil(share * self.total - 1e-9))
        seen = 0
        for index, count in enumerate(self.counts):
            seen += count
            if seen >= rank:
                return middle_of(index)
        return 0.0


def bin_of(value_ns: int) -> int:
    """Number of the bin a duration [ns] falls into."""
    units = max(0, value_ns) >> _UNIT_BITS
    if units < _STEPS:
        return units
    octave = units.bit_length() - _STEPS.bit_length()
    return min(BINS - 1, octave * _STEPS + (units >> octave))


def middle_of(index: int) -> float:
    """Middle of a bin [ns]."""
    if index < _STEPS:
        return (index + 0.5) * (1 << _UNIT_BITS)
    octave, step = divmod(index, _STEPS)
    octave -= 1
    return float((step + _STEPS + 0.5) * (1 << (octave + _UNIT_BITS)))
