"""Hands on the processes of a rig: kill, stop, wait for the next one."""

import contextlib
import os
import signal
import time
from pathlib import Path

from rig import Rig, is_alive


def rounds(usual: int) -> int:
    """How often a campaign does it: FAULT_ROUNDS, or what is usual."""
    return int(os.environ.get("FAULT_ROUNDS", usual))


def kill(rig: Rig, name: str) -> int:
    """Kill a process by the supervisor's word; its id."""
    pid = rig.pid(name)
    assert pid is not None
    os.kill(pid, signal.SIGKILL)
    rig.wait_for(lambda: not is_alive(pid), f"the {name} to be gone")
    return pid


def replaced(rig: Rig, name: str, old: int) -> None:
    rig.wait_for(lambda: rig.pid(name) not in (None, old), f"another {name}")


def is_loaded(pid: int | None) -> bool:
    """Whether a spare is through with its imports: the kernel lists it as waiting for the lock."""
    waiting = [line for line in Path("/proc/locks").read_text("ascii").splitlines() if "->" in line]
    return any(line.split()[5] == str(pid) for line in waiting)


def freeze(pid: int, seconds: float) -> None:
    """Stop a process for so long; it may be killed meanwhile."""
    os.kill(pid, signal.SIGSTOP)
    try:
        time.sleep(seconds)
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGCONT)
