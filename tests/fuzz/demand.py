"""What targets demand of a decoder, and the few formulas that more than one needs."""

import math

KEY = b"a key for fuzzing only, 32 bytes"
NOW = 1_000_000_000_000


def must(right, what):
    """An invariant."""
    assert right, what


def words(error, *needed, most=500):
    """An error must be of use: not empty, not endless, and naming what it is about."""
    text = str(error)
    assert 15 <= len(text) <= most, f"message of {len(text)} characters: {text[:200]}"
    for one in needed:
        assert one in text, f"{one!r} is not named in {text!r}"


def same(found, wanted, name):
    assert found == wanted, f"{name}: {found!r} read, {wanted!r} sent"


def gravity_of(roll, pitch):
    return (
        -9.81 * math.sin(pitch),
        9.81 * math.sin(roll) * math.cos(pitch),
        9.81 * math.cos(roll) * math.cos(pitch),
    )


def close(found, wanted, gravity):
    for one, value, g in zip(found, wanted, gravity, strict=True):
        assert abs(one - (value + g)) <= 1e-9 + 1e-12 * abs(value), f"{one} is not {value} + {g}"


def is_number(*tables):
    for table in tables:
        for value in table.flat if hasattr(table, "flat") else (table,):
            assert math.isfinite(value), f"{value} came through"
