"""Sequence numbers: which of two packets was sent later."""


def sequence_delta(newer: int, older: int) -> int:
    """How many packets lie from `older` to `newer`, across the wrap at 2^32.

    Returns:
        A number in [-2^31, 2^31): positive when `newer` was indeed sent later.
    """
    return ((newer - older + 0x80000000) & 0xFFFFFFFF) - 0x80000000
