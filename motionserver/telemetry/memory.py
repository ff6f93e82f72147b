"""Keep a process in memory: pages locked, and memory that was had once not given back."""

from __future__ import annotations

import ctypes
import os
import resource
from pathlib import Path
from typing import Final

_CURRENT, _FUTURE, _WHEN_TOUCHED = 1, 2, 4
_TRIM, _MAP_ABOVE = -1, -3
"""Options of glibc's mallopt: how much free memory to keep, and what size to map apart."""
_STACK: Final = 16 << 20
"""Room a growing stack needs below the limit [bytes]."""
_ALL: Final = 0x7FFFFFFF
_LARGEST: Final = 32 << 20
"""What glibc allows for the size from which a block is mapped apart [bytes]."""


def lock_memory(wanted: bool) -> str:
    """Lock everything this process has, and will have, into memory.

    A page that is not there costs a tick 0.2 to 1 us if memory is free, and 10 ms and more if it
    lies on a disk. A page is locked once it is touched: all that is mapped at once would be four
    times as much, and a guard that is killed would let go of its lock 13 ms later for it.

    Args:
        wanted: False leaves everything as it is.

    Returns:
        What is in force, for people.
    """
    if not wanted:
        return "memory not locked, as configured"
    libc = ctypes.CDLL(None, use_errno=True)
    _keep_heap(libc)
    unlimited = resource.RLIM_INFINITY
    for limits in ((unlimited, unlimited), (resource.getrlimit(resource.RLIMIT_MEMLOCK)[1],) * 2):
        try:
            resource.setrlimit(resource.RLIMIT_MEMLOCK, limits)
            break
        except (OSError, ValueError):
            continue
    limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    try:
        if libc.mlockall(_CURRENT | _WHEN_TOUCHED) != 0:
            why = os.strerror(ctypes.get_errno())
            allowed = "unlimited" if limit == unlimited else f"{limit >> 20} MiB"
            return f"memory not locked ({why}; RLIMIT_MEMLOCK is {allowed})"
        # under a limit memory asked for later would be refused, unless we were just excused from it
        if limit != unlimited and (room := limit - _locked()) >= 0:
            if room >= _STACK:
                return "memory locked as of the start"
            # a locked stack that may not grow ends the process
            libc.munlockall()
            return f"memory not locked (RLIMIT_MEMLOCK of {limit >> 20} MiB leaves no room)"
        later = libc.mlockall(_CURRENT | _FUTURE | _WHEN_TOUCHED) == 0
    except AttributeError:
        return "memory not locked: no mlockall here"
    return "memory locked" if later else "memory locked as of the start"


def _locked() -> int:
    """Bytes that are locked."""
    try:
        text = Path("/proc/self/status").read_text("ascii", "replace")
    except OSError:
        return 0
    told = text.partition("VmLck:")[2].split()
    return int(told[0]) << 10 if told else 0


def _keep_heap(libc: ctypes.CDLL) -> None:
    """Arrays come from a heap that never shrinks: no page is asked for twice."""
    try:
        libc.mallopt(_MAP_ABOVE, _LARGEST)
        libc.mallopt(_TRIM, _ALL)
    except AttributeError:
        # another C library than glibc has its own rules
        return
