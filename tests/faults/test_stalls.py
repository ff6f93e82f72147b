"""The active guard stands still for a moment, again and again: its packets keep apart all the same.

Judged by the instants at which the kernel handed the packets to the base.
"""

import json
import sys
import time
from pathlib import Path
from random import Random

import pytest
from far_ends import FarRig
from process_hands import freeze, rounds
from rig import assert_soft
from setpoint_log import assert_apart, largest_step, spacings, spread, wall_speeds


def stall(tmp_path: Path, count: int) -> None:
    """Let a guard in motion stall so often, for 4 to 30 ms."""
    random, log = Random(150), tmp_path / "base.log"
    with FarRig(tmp_path) as rig:
        rig.run()
        for _ in range(count):
            rig.wait_for(lambda: rig.state == "RUN", "RUN")
            time.sleep(random.uniform(0.02, 0.15))
            pid = rig.pid("guard")
            assert pid is not None
            freeze(pid, random.uniform(0.004, 0.03))
        takeovers = rig.counter("takeovers", "guard")
        assert rig.end() == 0
        verdict = rig.verdict()
    told = {
        "stalls": count,
        "packets": verdict["packets"],
        "takeovers": takeovers,
        "violations": verdict["violations"],
        "spacing": spread(spacings(log)),
        "closer_than_0.5": sum(gap < 0.5 for gap in spacings(log)),
        "closer_than_0.8": sum(gap < 0.8 for gap in spacings(log)),
        "wall_speed": spread(wall_speeds(log)),
        "speed": verdict["speed_max"],
        "step_mm": 1e3 * largest_step(log),
        "mean_rate_hz": verdict["mean_rate_hz"],
    }
    sys.stdout.write(f"\nstalls: {json.dumps(told, indent=2)}\n")
    assert_soft(verdict)
    assert verdict["judged_in_wall_time"]
    assert_apart(log)


def test_a_guard_that_stalls_sends_no_packets_close_together(tmp_path: Path) -> None:
    stall(tmp_path, 10)


@pytest.mark.campaign
@pytest.mark.timeout(3600)
def test_a_guard_that_stalls_150_times_sends_no_packets_close_together(tmp_path: Path) -> None:
    stall(tmp_path, rounds(150))
