"""Offline commands end with all their workers, and leave nothing behind."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from rig import environment, is_alive, until

import motionserver
from motionserver.evaluate.worker_pool import worker_pool

FOLDER = Path(motionserver.__file__).parent
TUNE = [
    *("-m", "motionserver", "tune", "--jobs", "2", "--out"),
    "OUT",
    *(f"clients/motion_clients/recordings/truck_{name}.csv" for name in ("puncture", "rough_road")),
]
SCRIPT = """
import time
import motionserver
from motionserver.evaluate.worker_pool import worker_pool
if __name__ == "__main__":
    with worker_pool(2) as pool:
        for _ in pool.map(time.sleep, [3600.0] * 8):
            pass
"""


def children(pid: int) -> list[int]:
    found = Path(f"/proc/{pid}/task/{pid}/children").read_text("ascii")
    return [int(child) for child in found.split()]


def is_worker(pid: int) -> bool:
    try:
        return b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return False


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
@pytest.mark.parametrize("what", ["script", "tune"])
def test_command_ended_by_signal_takes_its_workers_along(tmp_path, what, number):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT, "utf-8")
    arguments = [str(script)] if what == "script" else TUNE
    process = subprocess.Popen(
        [sys.executable, *(str(tmp_path / "out") if one == "OUT" else one for one in arguments)],
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        process_group=0,
    )
    try:
        until(lambda: sum(map(is_worker, children(process.pid))) >= 2, "two workers")
        workers = children(process.pid)
        process.send_signal(number)
        _, said = process.communicate(timeout=120.0)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
    assert "leaked" not in said, said
    # of the interrupted script itself one is usual, of the pool none
    assert "process.py" not in said, said
    assert process.returncode in (130, 143, -number), said
    until(lambda: not any(map(is_alive, workers)), "the workers to end")


def test_offline_commands_start_workers_in_this_way_only():
    using = {
        str(path.relative_to(FOLDER))
        for path in FOLDER.rglob("*.py")
        if "ProcessPoolExecutor" in path.read_text("utf-8")
    }
    assert using == {"evaluate/worker_pool.py"}


def test_workers_leave_the_keyboard_to_their_parent():
    with worker_pool(1) as pool:
        asked = pool.submit(signal.getsignal, signal.SIGINT).result(60.0)
        threads = pool.submit(os.getenv, "OPENBLAS_NUM_THREADS").result(60.0)
    assert asked is signal.SIG_IGN
    assert threads == "1"
