"""Locking memory, each time in a process of its own: granted, limited, refused; never a failure."""

import re
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from motionserver.telemetry import memory

ROOT = Path(__file__).parent.parent.parent
SCENE = """
import ctypes, resource, sys
from motionserver.telemetry.memory import lock_memory
limit, drop, wanted = int(sys.argv[1]), sys.argv[2] == "drop", sys.argv[3] == "wanted"
if drop:
    # the bounding set does not matter: a process that is not root has no capability
    import os
    if os.geteuid() == 0:
        os.setresuid(65534, 65534, 65534)
if limit >= 0:
    resource.setrlimit(resource.RLIMIT_MEMLOCK, (limit, limit))
print(lock_memory(wanted))
more = bytearray(64 << 20)
print(open("/proc/self/status").read())
"""


def run(limit: int, drop: bool, wanted: bool = True) -> tuple[str, int]:
    """What it says, and how much is locked in the end [MiB]."""
    words = (str(limit), "drop" if drop else "keep", "wanted" if wanted else "not")
    done = subprocess.run(
        [sys.executable, "-c", SCENE, *words],
        capture_output=True,
        text=True,
        check=True,
        cwd=ROOT,
    )
    said, _, status = done.stdout.partition("\n")
    found = re.search(r"VmLck:\s+(\d+)", status)
    assert found is not None
    return said, int(found[1]) >> 10


def test_not_wanted_is_not_done() -> None:
    assert run(-1, drop=False, wanted=False) == ("memory not locked, as configured", 0)


def test_refused_is_told_with_the_limit() -> None:
    said, locked = run(1 << 20, drop=True)
    assert re.fullmatch(r"memory not locked \(.+; RLIMIT_MEMLOCK is 1 MiB\)", said)
    assert locked == 0


def test_under_a_limit_memory_asked_for_later_is_still_had() -> None:
    limit = 60 << 20
    hard = resource.getrlimit(resource.RLIMIT_MEMLOCK)[1]
    if hard != resource.RLIM_INFINITY and hard < limit:
        pytest.skip("this user may not lock 60 MiB")
    said, locked = run(limit, drop=True)
    assert said == "memory locked as of the start"
    assert 1 <= locked <= 60


def test_with_the_capability_everything_is_locked() -> None:
    if not _may_lock():
        pytest.skip("this user may not lock memory")
    said, locked = run(1 << 20, drop=False)
    assert said == "memory locked"
    assert locked >= 64


class Kernel:
    """A C library that grants or refuses, and remembers what is locked."""

    def __init__(self, *refuses: int) -> None:
        self.refuses = refuses
        self.flags: list[int] = []

    def mlockall(self, flags: int) -> int:
        self.flags.append(flags)
        return -1 if flags in self.refuses else 0

    def munlockall(self) -> int:
        self.flags.append(0)
        return 0

    def mallopt(self, option: int, value: int) -> int:
        return 1


@pytest.mark.parametrize(
    ("limit", "locked", "refuses", "said", "flags"),
    [
        (-1, 100, (), "memory locked", [5, 7]),
        (-1, 100, (7,), "memory locked as of the start", [5, 7]),
        (-1, 0, (5,), "memory not locked (Success; RLIMIT_MEMLOCK is unlimited)", [5]),
        (200, 100, (), "memory locked as of the start", [5]),
        (116, 100, (), "memory locked as of the start", [5]),
        (115, 100, (), "memory not locked (RLIMIT_MEMLOCK of 115 MiB leaves no room)", [5, 0]),
        (100, 100, (), "memory not locked (RLIMIT_MEMLOCK of 100 MiB leaves no room)", [5, 0]),
        (8, 100, (), "memory locked", [5, 7]),
    ],
)
def test_what_a_limit_leaves(
    monkeypatch: pytest.MonkeyPatch,
    limit: int,
    locked: int,
    refuses: tuple[int, ...],
    said: str,
    flags: list[int],
) -> None:
    kernel = Kernel(*refuses)
    bytes_of = limit if limit < 0 else limit << 20
    monkeypatch.setattr(memory.ctypes, "CDLL", lambda *_, **__: kernel)
    monkeypatch.setattr(memory.ctypes, "get_errno", lambda: 0)
    monkeypatch.setattr(memory.resource, "getrlimit", lambda _: (bytes_of, bytes_of))
    monkeypatch.setattr(memory.resource, "setrlimit", lambda *_: None)
    monkeypatch.setattr(memory, "_locked", lambda: locked << 20)
    assert memory.lock_memory(True) == said
    assert kernel.flags == flags


def _may_lock() -> bool:
    """CAP_IPC_LOCK."""
    text = Path("/proc/self/status").read_text("ascii")
    return bool(int(text.partition("CapEff:")[2].split()[0], 16) >> 14 & 1)
