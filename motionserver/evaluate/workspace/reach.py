"""How far a machine gets and what ends it, as the survey asks; computed in core.kinematics."""

from motionserver.core.kinematics.reach import (
    Ending,
    Exits,
    Limit,
    endings,
    first_exits,
    posture_allowed,
    reachable,
)

__all__ = ["Ending", "Exits", "Limit", "endings", "first_exits", "posture_allowed", "reachable"]
