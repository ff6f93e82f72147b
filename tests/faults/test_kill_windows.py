"""A guard is killed in the worst moments: right before it sends a packet, and right after."""

import os
from pathlib import Path

import pytest
from far_ends import FarRig
from process_hands import is_loaded
from rig import ROOT, assert_soft
from setpoint_log import assert_apart, periods_of_motion

FAST = 0.1
"""A leg that is faster shows a sample sent twice [m/s]."""
DEATH = '''
"""Loaded by every interpreter that starts: lets a guard die about one packet, when asked to."""
import os, signal, sys

if "motionserver.guard" in sys.orig_argv:
    from motionserver.guard.ports import Ports

    send = Ports.send

    def die(where):
        try:
            os.unlink(os.path.join(os.environ["DEATHS"], where))
        except FileNotFoundError:
            return
        os.kill(os.getpid(), signal.SIGKILL)

    def send_and_die(self, setpoint):
        die("before")
        is_sent = send(self, setpoint)
        die("after")
        return is_sent

    Ports.send = send_and_die
'''


@pytest.mark.parametrize("where", [pytest.param("before", marks=pytest.mark.campaign), "after"])
def test_a_guard_that_dies_about_a_packet_leaves_no_sample_out_and_sends_none_twice(
    tmp_path: Path, where: str
) -> None:
    (tmp_path / "sitecustomize.py").write_text(DEATH, "utf-8")
    folders = [str(tmp_path), *(str(ROOT / name) for name in ("", "protocol", "clients"))]
    path = f"PYTHONPATH={os.pathsep.join(folders)}"
    with FarRig(tmp_path, within=("env", path, f"DEATHS={tmp_path}")) as rig:
        rig.run()
        rig.wait_for(lambda: is_loaded(rig.pid("spare")), "the spare to be loaded")
        old = rig.pid("guard")
        rig.wait_for(lambda: max(map(abs, rig.shown()["leg_speed"])) > FAST, "a fast leg")
        (tmp_path / where).touch()
        rig.wait_for(lambda: rig.shown().get("pid") not in (None, old), "the spare's word")
        assert rig.counter("takeovers", "guard") == 1
        rig.wait_plans(10)
        assert rig.end() == 0
        verdict = rig.verdict()
    told = periods_of_motion(tmp_path / "base.log")
    # a sample sent twice is a step of nothing, one left out is a step of two periods
    assert 0.5 < min(told) <= max(told) < 1.5
    assert_soft(verdict)
    assert_apart(tmp_path / "base.log")
