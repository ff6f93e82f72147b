"""Work in slices: a generator that rests between them and returns what the whole would."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from typing import Final, TypeVar

T = TypeVar("T")
Slices = Generator[None, None, T]
"""Each ``next`` does one slice; the result comes with `StopIteration`."""

LEAST: Final = 16
"""Fewest samples of a block: a product of very few columns may round otherwise than the whole."""


def whole(slices: Slices[T]) -> T:
    """Do all slices at once."""
    while True:
        try:
            next(slices)
        except StopIteration as done:
            result: T = done.value
            return result


def blocks(count: int, size: int) -> Iterator[tuple[int, int]]:
    """First and behind-last row of each block of ``size`` rows; a short rest joins the last one."""
    begin = 0
    while begin < count:
        end = begin + size
        if count - end < LEAST:
            end = count
        yield begin, end
        begin = end
