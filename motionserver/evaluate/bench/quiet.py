"""A process that measures: nothing collected meanwhile, with the priority of what it stands for."""

from __future__ import annotations

import contextlib
import gc
from collections.abc import Iterator

from motionserver.telemetry.realtime import take_priority


@contextlib.contextmanager
def quiet(priority: int) -> Iterator[str]:
    """Ask for SCHED_FIFO (0: not) and keep the collector away; yields what scheduling there is."""
    scheduling = take_priority(max(priority, 1), priority > 0)
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        yield scheduling
    finally:
        gc.enable()
        gc.unfreeze()
