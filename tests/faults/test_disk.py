"""The disk that everything is written to fills up in motion, and is freed again."""

import contextlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import Any

import pytest
from far_ends import FarRig
from process_hands import is_loaded, kill, replaced, rounds
from rig import assert_soft, cli, command, environment
from setpoint_log import STEP, largest_step, spread

from motionserver.telemetry.mapped import MappedFile

pytestmark = [pytest.mark.campaign, pytest.mark.timeout(3600)]
FREE_MB = 6
"""What stays free once a server runs: room for recordings and dumps [MB]."""
SIZE_MB = 96


class Disk:
    """A small disk in memory, with a file that fills it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._filler = folder / "filler"

    @property
    def free(self) -> int:
        """Bytes that are left."""
        room = os.statvfs(self.folder)
        return room.f_bavail * room.f_frsize

    def fill(self, leave: int = 0) -> None:
        """Take all room but ``leave`` bytes, to the last byte."""
        with self._filler.open("ab", buffering=0) as file, contextlib.suppress(OSError):
            while (left := self.free - leave) > 0:
                file.write(bytes(min(left, 1 << 20)))

    def free_again(self) -> None:
        self._filler.write_bytes(b"")
        self.fill(leave=FREE_MB << 20)


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Disk]:
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={SIZE_MB}m", "tmpfs", str(folder)]
    done = subprocess.run(mount, capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip(f"no small disk: {done.stderr.strip()}")
    try:
        yield Disk(folder)
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=False)


def on(disk: Disk, folder: Path) -> Path:
    """Let all that a server writes be on the disk, its log included."""
    for name in ("run", "state"):
        (disk.folder / name).mkdir()
        (folder / name).symlink_to(disk.folder / name)
    (folder / "server.log").symlink_to(disk.folder / "server.log")
    return folder


def record(rig: FarRig, out: Path) -> subprocess.Popen[str]:
    """`motionserver record`, as somebody runs it beside a drive."""
    out.unlink(missing_ok=True)
    process = subprocess.Popen(
        command("record", str(rig.config), "--out", str(out)),
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    rig.wait_for(out.exists, "the recording to begin")
    return process


def dumped(rig: FarRig) -> dict[str, Any]:
    """What the black box says it did."""
    message = MappedFile(rig.run_dir / "blackbox.map").read()
    return {} if message is None else json.loads(message[1])


def goes_on(rig: FarRig) -> None:
    """It drives; a base that a busy machine silenced for a moment was reset by the operator."""
    rig.drives_again()
    rig.wait_plans(20)
    assert rig.counter("tick_errors") == rig.counter("tick_errors", "guard") == 0


def one_fill(rig: FarRig, disk: Disk, number: int, wait: float) -> dict[str, Any]:
    """Fill it at a random moment, have page and guard die on it, free it, and see who writes."""
    rig.drives_again()
    rig.wait_for(lambda: is_loaded(rig.pid("spare")), "the spare to be loaded")
    out = disk.folder / "drive.csv"
    recording = record(rig, out)
    time.sleep(wait)
    began = time.monotonic()
    disk.fill()
    assert disk.free == 0
    replaced(rig, "web", kill(rig, "web"))
    takeovers = rig.counter("takeovers", "guard")
    replaced(rig, "spare", kill(rig, "guard"))
    rig.wait_for(lambda: rig.counter("takeovers", "guard") > takeovers, "the spare's word")
    if not number:
        # deaths that repeat are written down once a minute
        rig.wait_for(lambda: dumped(rig)["failed"], "a dump that failed")
    goes_on(rig)
    # the row that finds no room ends the recording, in words; the motion goes on
    rig.wait_for(lambda: recording.poll() is not None, "the recording to end")
    assert recording.returncode != 0
    told = recording.communicate()[1]
    assert "No space left on device" in told, told
    assert "the motion goes on" in told, told
    full = time.monotonic() - began
    disk.free_again()
    again = record(rig, out)
    rig.wait_plans(60)
    size = out.stat().st_size
    rig.wait_for(lambda: out.stat().st_size > size, "rows")
    again.terminate()
    assert again.wait(60.0) == 0
    assert again.communicate()[0].count("rows in") == 1
    goes_on(rig)
    return {"number": number, "full_s": full, "failed": dumped(rig)["failed"]}


def test_one_fill(tmp_path: Path, disk: Disk) -> None:
    with FarRig(on(disk, tmp_path), web=True) as rig:
        rig.run()
        disk.free_again()
        rig.wait_for(lambda: rig.pid("web"), "the page")
        one_fill(rig, disk, 0, 0.3)
        # it parks and ends in order on a disk that is full
        disk.fill()
        assert rig.end() == 0
        verdict = rig.verdict()
    assert_soft(verdict)
    assert largest_step(tmp_path / "base.log") < STEP


def test_fills(tmp_path: Path, disk: Disk) -> None:
    random, figures = Random(451), []
    with FarRig(on(disk, tmp_path), web=True) as rig:
        rig.run()
        disk.free_again()
        rig.wait_for(lambda: rig.pid("web"), "the page")
        for number in range(rounds(20)):
            figures.append(one_fill(rig, disk, number, random.uniform(0.2, 3.0)))
            print(figures[-1], flush=True)
        box = dumped(rig)
        faults = rig.shown()["counters"].get("entered_fault", 0)
        listed = cli("blackbox", "list", "--config", str(rig.config)).stdout
        assert rig.end() == 0
        verdict = rig.verdict()
    told = {"fills": len(figures), "violations": verdict["violations"], "box": box}
    told |= {"faults": faults}
    told["full_s"] = spread([figure["full_s"] for figure in figures])
    for key in ("speed_max", "acceleration_max", "jerk_max", "gap_ms"):
        told[key] = verdict[key]
    sys.stdout.write(f"\ndisk: {json.dumps(told, indent=2)}\n{listed}\n")
    assert_soft(verdict)
    assert largest_step(tmp_path / "base.log") < STEP
