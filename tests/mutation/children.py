"""Forked children that each try one thing and tell what came of it."""

import os
import resource
import select
import signal
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

MEMORY = 4 << 30
"""Address space of a child beyond what it was born with [bytes]: a change may ask for no end."""


@dataclass
class _Child:
    task: Any
    pipe: int
    ends: float
    said: bytes = b""


def each(
    tasks: list[Any], work: Callable[[Any], str], workers: int, patience: float
) -> Iterator[tuple[Any, str]]:
    """Do every task in a child of its own, ``workers`` at a time.

    Yields:
        Task and the word its work returned; "died" if the child did not live to say one, "late" if
        it took longer than ``patience`` [s] of wall time.
    """
    waiting, living = list(reversed(tasks)), dict[int, _Child]()
    while waiting or living:
        while waiting and len(living) < workers:
            task = waiting.pop()
            pid, pipe = _born(task, work)
            living[pid] = _Child(task, pipe, time.monotonic() + patience)
        ready, _, _ = select.select([child.pipe for child in living.values()], [], [], 1.0)
        for pid, child in list(living.items()):
            late = time.monotonic() > child.ends
            if child.pipe in ready:
                said = os.read(child.pipe, 65536)
                child.said += said
                if said:
                    continue
            elif not late:
                continue
            if late:
                os.killpg(pid, signal.SIGKILL)
            os.close(child.pipe)
            os.waitpid(pid, 0)
            del living[pid]
            yield child.task, child.said.decode() or ("late" if late else "died")


def _born(task: Any, work: Callable[[Any], str]) -> tuple[int, int]:
    read, write = os.pipe()
    pid = os.fork()
    if pid:
        os.close(write)
        return pid, read
    try:
        # a group to be ended together; a session of its own would leave what this one is niced to
        os.setpgid(0, 0)
        os.close(read)
        nothing = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(nothing, stream)
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        most = pages * resource.getpagesize() + MEMORY
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        os.write(write, work(task).encode())
    finally:
        os._exit(0)


def limit_processor(seconds: float) -> None:
    """From now on this process may use so much processor time [s], then it dies."""
    signal.signal(signal.SIGPROF, signal.SIG_DFL)
    signal.setitimer(signal.ITIMER_PROF, seconds)
