"""A child is started again: at once after a long life, ever more slowly after short ones."""

import asyncio
import os
import signal
import sys
from pathlib import Path

import pytest
from rig import until

from motionserver.supervisor import child as room
from motionserver.supervisor.child import SLOWEST, Child
from motionserver.telemetry.parent import PARENT


class Slept:
    """Notes pauses and ends the child's keeping after some of them."""

    def __init__(self, child: Child, rounds: int) -> None:
        self.child, self.rounds, self.pauses = child, rounds, list[float]()

    async def __call__(self, pause: float) -> None:
        self.pauses.append(pause)
        if len(self.pauses) >= self.rounds:
            self.child.wanted = False


async def test_pauses_grow_to_the_slowest(monkeypatch: pytest.MonkeyPatch) -> None:
    child = Child("gone at once", ("-S", "-c", "raise SystemExit(7)"))
    slept = Slept(child, 6)
    monkeypatch.setattr(room.asyncio, "sleep", slept)
    await child.keep()
    assert slept.pauses == [0.2, 0.4, 0.8, 1.6, SLOWEST, SLOWEST]
    assert child.exits == [7] * 7
    assert child.restarts == 7
    assert child.pid is None


async def test_a_long_life_forgives(monkeypatch: pytest.MonkeyPatch) -> None:
    child = Child("lives long", ("-S", "-c", ""))
    monkeypatch.setattr(room, "QUICK", -1.0)
    asked = 0

    def may_start() -> bool:
        nonlocal asked
        asked += 1
        child.wanted = child.restarts < 3
        return True

    child.may_start = may_start
    await child.keep()
    assert (child.restarts, asked) == (3, 3)


async def test_it_waits_while_it_may_not_start(monkeypatch: pytest.MonkeyPatch) -> None:
    child = Child("waits", ("-S", "-c", ""), may_start=lambda: False)
    slept = Slept(child, 5)
    monkeypatch.setattr(room.asyncio, "sleep", slept)
    await child.keep()
    assert slept.pauses == [0.05] * 5
    assert len(child.exits) == 1


async def test_an_unwanted_child_never_starts() -> None:
    child = Child("unwanted", ("-c", ""), wanted=False)
    await child.keep()
    assert await child.ended(1.0) == 0
    child.signal(signal.SIGTERM)
    await child.end(signal.SIGTERM, 1.0)
    assert child.exits == []


@pytest.mark.parametrize(("heeds", "status"), [(True, -signal.SIGTERM), (False, -signal.SIGKILL)])
async def test_ending_asks_first_and_kills_the_deaf(
    tmp_path: Path, heeds: bool, status: int
) -> None:
    ready = tmp_path / "ready"
    deaf = "" if heeds else "signal.signal(15, signal.SIG_IGN);"
    code = f"import signal,sys;{deaf}open(sys.argv[1], 'w').close();signal.pause()"
    child = Child("ends", ("-S", "-c", code))
    process = await child.start(str(ready))
    with pytest.raises(TimeoutError):
        await child.ended(0.01)
    await asyncio.to_thread(until, ready.exists, "the child to be ready")
    await child.end(signal.SIGTERM, 30.0 if heeds else 0.3)
    assert process.returncode == status
    assert not child.wanted


async def test_a_child_knows_its_parent_and_has_a_group_of_its_own(tmp_path: Path) -> None:
    out = tmp_path / "out"
    code = "import os,sys;open(sys.argv[1],'w').write(f'{os.environ[sys.argv[2]]} {os.getpgid(0)}')"
    child = Child("asked", ("-S", "-c", code))
    process = await child.start(str(out), PARENT)
    assert await process.wait() == 0
    assert out.read_text() == f"{os.getpid()} {process.pid}"


async def test_an_orphan_does_not_stay() -> None:
    code = "from motionserver.telemetry.parent import follow_parent; follow_parent()"
    environment = {**os.environ, PARENT: "1", "PYTHONPATH": os.pathsep.join(sys.path)}
    process = await asyncio.create_subprocess_exec(sys.executable, "-c", code, env=environment)
    assert await process.wait() == 1
    del environment[PARENT]
    process = await asyncio.create_subprocess_exec(sys.executable, "-c", code, env=environment)
    assert await process.wait() == 0
