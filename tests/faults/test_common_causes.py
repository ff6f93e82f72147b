"""One cause that strikes guard and spare alike: files, the run directory, memory that runs out."""

import os
import shutil
import signal
import time
from pathlib import Path

import pytest
from far_ends import FarRig
from process_hands import is_loaded
from rig import assert_soft, is_alive
from setpoint_log import STEP, assert_apart, largest_step, pauses

HICCUP = {("RUN", "HOLD"), ("HOLD", "RUN")}


def loaded(rig: FarRig) -> None:
    """In motion, and both that wait are ready."""
    rig.run()
    for name in ("spare", "reserve"):
        rig.wait_for(lambda name=name: is_loaded(rig.pid(name)), f"the {name} to be loaded")


def test_files_that_their_owner_truncates_kill_nobody(tmp_path: Path) -> None:
    with FarRig(tmp_path, web=True) as rig:
        loaded(rig)
        rig.wait_for(lambda: rig.pid("web"), "the page")
        names = ("guard", "spare", "reserve", "planner", "web", "blackbox")
        before, way = [rig.pid(name) for name in names], rig.transitions()
        found = [path for path in rig.run_dir.rglob("*") if not path.is_dir()]
        refused = 0
        for path in found:
            for size in (0, 4096, 1 << 22):
                try:
                    os.truncate(path, size)
                except OSError:
                    refused += 1
        assert refused > 40
        rig.wait_plans(60)
        assert [rig.pid(name) for name in names] == before
        assert set(rig.transitions()[len(way) :]) <= HICCUP
        # and another can still be started
        old = rig.pid("guard")
        assert old is not None
        os.kill(old, signal.SIGKILL)
        rig.wait_for(lambda: rig.shown().get("pid") == before[1], "the spare's word")
        rig.wait_for(lambda: rig.pid("reserve") not in (None, *before), "another reserve")
        rig.wait_for(lambda: is_loaded(rig.pid("reserve")), "the reserve to be loaded")
        assert rig.end() == 0
        verdict = rig.verdict()
    assert_soft(verdict)
    assert largest_step(tmp_path / "base.log") < STEP


@pytest.mark.parametrize("kills", [False, True], ids=["alone", "and the guard dies"])
def test_a_run_directory_that_is_removed_in_motion_parks_softly(
    tmp_path: Path, kills: bool
) -> None:
    with FarRig(tmp_path) as rig:
        loaded(rig)
        # what the rig reads must stay: it has mapped it
        assert all(rig.shown(name) for name in ("guard", "service", "planner"))
        guard = rig.pid("guard")
        assert guard is not None
        shutil.rmtree(rig.run_dir)
        if kills:
            os.kill(guard, signal.SIGKILL)
        assert rig.server.wait(120.0) == 4
        assert f"the run directory {rig.run_dir} was removed" in rig.text()
        assert rig.transitions()[-1] == ("PARKING", "PARKED")
        assert f"-> PARKING: the service is ending: the run directory {rig.run_dir}" in rig.text()
        assert not rig.leftovers()
        verdict = rig.verdict()
    assert_soft(verdict)
    assert verdict["is_parked"]
    assert largest_step(tmp_path / "base.log") < STEP
    assert_apart(tmp_path / "base.log")


def test_guard_and_spare_that_die_together_have_a_successor(tmp_path: Path) -> None:
    log = tmp_path / "base.log"
    with FarRig(tmp_path) as rig:
        loaded(rig)
        # a guard that took over just before does not pass its state on
        time.sleep(1.5)
        pids = [rig.pid(name) for name in ("guard", "spare")]
        reserve = rig.pid("reserve")
        for pid in pids:
            assert pid is not None
            os.kill(pid, signal.SIGKILL)
        rig.wait_for(lambda: not any(is_alive(pid) for pid in pids if pid), "both to be gone")
        rig.wait_for(lambda: rig.shown().get("pid") == reserve, "the reserve's word")
        rig.wait_for(lambda: is_loaded(rig.pid("spare")), "another spare")
        # at once it goes on; had the spare sent already, it parks
        rig.wait_state("RUN", "HOLD", "PARKED")
        assert rig.end() == 0
        verdict = rig.verdict()
    print("longest pause", pauses(log)[-1], "periods")
    assert_soft(verdict)
    assert verdict["is_parked"]
    assert "FAULT" not in verdict["states_visited"]
    assert largest_step(log) < STEP
    assert_apart(log)
