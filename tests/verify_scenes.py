"""Plans to be judged, and a short word for the verdict."""

import numpy as np
from machines import compact

from motionserver.core.axes import frozen
from motionserver.core.motion.moves import rest_to_rest
from motionserver.core.plan import Plan, rest_at
from motionserver.core.safety.verify import (
    GUARD_MARGINS,
    Margins,
    judge,
)

ZERO = np.zeros(6)
STANDING = rest_at(ZERO)
BARE = Margins(0.0, 1.0, 1.0, 0.0, 1.0)


def table(count=5, **rows):
    """A plan of ``count`` knots that stands still, with some tables replaced."""
    still = {
        "times": np.linspace(0.0, 1.0, count),
        "pose": np.zeros((count, 6)),
        "velocity": np.zeros((count, 6)),
        "acceleration": np.zeros((count, 6)),
    }
    return Plan(1, 0, 0.1, **{k: frozen(rows.get(k, v)) for k, v in still.items()})


def edited(field, row, value, count=5):
    numbers = np.zeros((count, 6))
    numbers[row, 4] = value
    return table(count, **{field: numbers})


def hop(goal, duration, start=ZERO):
    return rest_to_rest(1, 0, 0.1, frozen(start), frozen(goal), duration)


def reason(plan, machine=None, margins=GUARD_MARGINS, parent=STANDING, before=None, homes=None):
    found = judge(machine or compact(), plan, parent, before, margins, homes)
    return None if found is None else found.reason
