"""What a guard leaves to its successor: a spare reads it in its first tick, or it is nothing."""

import math

import numpy as np
from demand import words

from motionserver.core.safety.states import State
from motionserver.core.safety.will import WillWriter, unpack_will


def will(data):
    """Parts with their lengths in front: a head as JSON, then plans."""
    try:
        found = unpack_will(data)
    except ValueError as error:
        words(error, "will of a guard: ")
        return False
    assert isinstance(found.state, State)
    for name in ("due_ns", "since_ns", "deadline_ns", "accepted_ns", "next_id", "taken_ns"):
        assert type(getattr(found, name)) is int, f"{name} is {getattr(found, name)!r}"
    assert type(found.leaving) is type(found.engaged_once) is bool
    assert isinstance(found.reason, str)
    assert isinstance(found.clock, (int, float))
    assert math.isfinite(found.clock), f"a clock of {found.clock}"
    for name, count in found.counters.items():
        assert isinstance(name, str)
        assert type(count) is int, f"{name} counts {count!r}"
    told = found.feedback
    if told is not None:
        assert type(told.arrival_ns) is int
        assert isinstance(told.state, str)
        assert type(told.estop) is bool
        for table in (told.legs, told.pose):
            assert table is None or (table.shape == (6,) and np.isfinite(table).all()), table
    again = WillWriter().pack(found)
    assert WillWriter().pack(unpack_will(again)) == again, "written again it differs"
    return True
