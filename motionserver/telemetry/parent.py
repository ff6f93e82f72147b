"""A child follows its supervisor: the kernel tells it when the supervisor has died."""

from __future__ import annotations

import ctypes
import os
import signal
from typing import Final

PARENT: Final = "SUPERVISOR_PID"
"""Environment variable in which a supervisor tells a child who it is."""
_PR_SET_PDEATHSIG: Final = 1


def follow_parent() -> None:
    """Ask for SIGTERM when the parent dies, however it dies: the guard then parks and ends.

    Raises:
        OSError: The kernel refuses.
        SystemExit: The supervisor died before it could be followed.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM, 0, 0, 0) != 0:
        raise OSError(ctypes.get_errno(), "prctl(PR_SET_PDEATHSIG)")
    parent = os.environ.get(PARENT)
    if parent is not None and parent != str(os.getppid()):
        raise SystemExit(1)
