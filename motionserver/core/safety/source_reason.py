"""Why the source is not fresh, in words that name the side that is late, with its age."""

from __future__ import annotations

from typing import Final

from motionserver.core.safety.watchdog import SECOND, CueStatus

_LATE_NS: Final = 50_000_000
"""A planner that reported more recently is not late [ns]."""


def source_reason(status: CueStatus, now_ns: int) -> str:
    """Why no packet of the source counts now; asked only while it is not fresh.

    Args:
        status: What the planner reported last.
        now_ns: Now [ns].
    """
    heard = max(status.heard_ns, status.newest_ns)
    looked = max(status.looked_ns, heard)
    if looked == 0:
        return "the planner has not reported yet: it is starting, or its process has ended"
    late = now_ns - looked
    # the larger share of the age is to blame
    if late > _LATE_NS and (heard == 0 or late > looked - heard):
        until = "the simulator was heard by it until then" if heard else "it had heard no simulator"
        return f"the planner has not reported for {_ago(late)}; {until}"
    if status.trouble:
        return status.trouble
    if heard == 0:
        return "no packet of a simulator has arrived: start the simulator first"
    return f"the simulator's newest packet is {_ago(now_ns - heard)} old"


def _ago(age_ns: int) -> str:
    return f"{age_ns / SECOND:.1f} s" if age_ns >= SECOND else f"{age_ns / 1e6:.0f} ms"
