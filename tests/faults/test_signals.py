"""Every signal whose default is death, to every process in motion: only SIGKILL ends one."""

import contextlib
import os
import signal
import sys
import time
from pathlib import Path

import pytest
from far_ends import FarRig
from process_hands import is_loaded
from rig import assert_soft, is_alive
from setpoint_log import assert_apart

WITHOUT_EFFECT = {
    *(signal.SIGCHLD, signal.SIGCONT, signal.SIGURG, signal.SIGWINCH),
    *(signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU),
}
"""Their default ends nobody: POSIX."""
DEADLY = sorted(set(range(1, 65)) - WITHOUT_EFFECT - {signal.SIGKILL, signal.SIGSTOP})
"""All of Linux, those that the C library reserves as well."""
PARKS = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT, signal.SIGPWR)
CHILDREN = ("guard", "spare", "planner", "web", "blackbox")
TERMINAL = """
import os, pty, sys, time
child, terminal = pty.fork()
if child == 0:
    os.execvp(sys.argv[2], sys.argv[2:])
os.set_blocking(terminal, False)
while not os.path.exists(sys.argv[1]):
    try:
        os.write(1, os.read(terminal, 65536))
    except BlockingIOError:
        time.sleep(0.01)
os.close(terminal)
sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""
"""A terminal in which the command runs, and that is closed when a file appears."""


def pids(rig: FarRig) -> dict[str, int]:
    found = {name: rig.pid(name) for name in CHILDREN}
    assert None not in found.values()
    return {name: pid for name, pid in found.items() if pid is not None}


def ignored_or_caught(pid: int) -> set[int]:
    lines = Path(f"/proc/{pid}/status").read_text("ascii").splitlines()
    masks = [int(line.split()[1], 16) for line in lines if line.startswith(("SigIgn", "SigCgt"))]
    return {number for number in range(1, 65) if (masks[0] | masks[1]) >> (number - 1) & 1}


def test_no_signal_but_kill_ends_a_process_in_motion(tmp_path: Path) -> None:
    with FarRig(tmp_path, web=True) as rig:
        rig.run()
        rig.wait_for(lambda: None not in map(rig.pid, CHILDREN), "all children")
        rig.wait_for(lambda: is_loaded(rig.pid("spare")), "the spare to be loaded")
        rig.wait_for(lambda: rig.shown("planner").get("pid"), "the planner's word")
        before, way = pids(rig), rig.transitions()
        for name, pid in {**before, "service": rig.server.pid}.items():
            assert set(DEADLY) <= ignored_or_caught(pid), name
        for number in DEADLY:
            victims = {**before, "service": rig.server.pid}
            if number in (*PARKS, signal.SIGXCPU):
                # what asks a service to end parks, and is its own test
                del victims["service"]
            if number == signal.SIGTERM:
                continue
            if number == signal.SIGINT:
                # by it the service tells its black box to end
                del victims["blackbox"]
            for pid in victims.values():
                os.kill(pid, number)
        rig.wait_plans(30)
        assert rig.server.poll() is None
        assert pids(rig) == before
        assert set(rig.transitions()[len(way) :]) <= {("RUN", "HOLD"), ("HOLD", "RUN")}
        # a closed terminal, or `pkill -HUP`: everybody gets it
        for pid in (*before.values(), rig.server.pid):
            os.kill(pid, signal.SIGHUP)
        assert rig.server.wait(120.0) == 0
        assert rig.transitions()[-2:] == [("RUN", "PARKING"), ("PARKING", "PARKED")]
        verdict = rig.verdict()
    assert_soft(verdict)
    assert verdict["is_parked"]
    assert_apart(tmp_path / "base.log")


@pytest.mark.campaign
@pytest.mark.parametrize("number", [*PARKS, signal.SIGXCPU], ids=lambda n: n.name)
def test_what_asks_for_an_end_parks_whoever_gets_it(tmp_path: Path, number: signal.Signals) -> None:
    with FarRig(tmp_path, web=True) as rig:
        rig.run()
        rig.wait_for(lambda: None not in map(rig.pid, CHILDREN), "all children")
        for pid in (*pids(rig).values(), rig.server.pid):
            os.kill(pid, number)
        assert rig.server.wait(120.0) == 0
        assert rig.transitions()[-1] == ("PARKING", "PARKED")
        verdict = rig.verdict()
    assert_soft(verdict)
    assert verdict["is_parked"]


def test_a_terminal_that_closes_parks_the_platform(tmp_path: Path) -> None:
    close = tmp_path / "close"
    with FarRig(tmp_path, within=(sys.executable, "-c", TERMINAL, str(close))) as rig:
        rig.run()
        close.touch()
        assert rig.server.wait(120.0) == 0
        assert not rig.leftovers()
        verdict = rig.verdict()
    assert_soft(verdict)
    assert verdict["is_parked"]


def test_a_process_that_has_just_started_is_ended_by_no_signal(tmp_path: Path) -> None:
    """Between exec and its own handlers, too: a spare that is replaced is never without cover."""
    with FarRig(tmp_path) as rig:
        rig.wait_state("PARKED")
        for name in ("spare", "reserve"):
            rig.wait_for(lambda name=name: is_loaded(rig.pid(name)), f"the {name} to be loaded")
        before = {rig.pid(name) for name in ("guard", "spare", "reserve")}
        old = rig.pid("spare")
        assert old is not None
        os.kill(old, signal.SIGKILL)
        # the reserve is the spare now, and the one that starts is the reserve
        rig.wait_for(lambda: rig.pid("reserve") not in (None, *before), "another reserve")
        new = rig.pid("reserve")
        assert new is not None
        early = 0
        while not is_loaded(new):
            # SIGTERM is remembered: it parks once the turn comes
            for number in set(DEADLY) - {32, 33, signal.SIGTERM}:
                os.kill(new, number)
            early += 1
            assert is_alive(new)
            time.sleep(0.01)
        assert early > 3
        assert rig.pid("reserve") == new
        assert rig.end() == 0
    with contextlib.suppress(OSError):
        rig.verdict()
