"""Ask the kernel for punctuality; say what it granted."""

from __future__ import annotations

import os


def take_priority(fifo: int, wanted: bool) -> str:
    """Ask for SCHED_FIFO, then for a better nice value.

    Args:
        fifo: Real-time priority, 1..99; the guard's is above the planner's.
        wanted: False leaves everything as it is.

    Returns:
        What is in force, for people: the page and the log show it.
    """
    if not wanted:
        return "normal scheduling, as configured"
    try:
        # children must not inherit it: a real-time web server would starve the guard
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(fifo))
    except OSError:
        pass
    else:
        return f"SCHED_FIFO {fifo}"
    try:
        os.setpriority(os.PRIO_PROCESS, 0, -10)
    except OSError:
        return "normal scheduling: no permission for SCHED_FIFO, ticks may be late under load"
    return "nice -10: no permission for SCHED_FIFO"
