"""A simulator that publishes over Zenoh freezes: its message's age decides, not Zenoh's lease."""

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from far_ends import FarRig
from rig import PATIENCE, assert_soft, environment, free_port, prompt

PUBLISHER = """
import json, math, sys, time
import zenoh
from motion_protocol import Cue, Motion, encode_cue

config = zenoh.Config()
for key, value in (
    ("mode", "client"),
    ("connect/endpoints", [sys.argv[1]]),
    ("scouting/multicast/enabled", False),
):
    config.insert_json5(key, json.dumps(value))
session = zenoh.open(config)
publisher = session.declare_publisher("motion/0/in/cue")
for sequence in range(1000000):
    t = time.monotonic()
    surge = 2.0 * math.sin(2.0 * t)
    motion = Motion((surge, 0.5 * surge, 0.0), (0.0, 0.0, 0.0), speed=10.0)
    publisher.put(encode_cue(Cue(4711, sequence, int(t * 1e9), time.monotonic_ns(), motion)))
    time.sleep(0.01)
"""
LEASE = 1.0
"""After so long the server's Zenoh gives a frozen peer up [s]; the guard must be much quicker."""


@pytest.mark.campaign
def test_a_frozen_publisher_is_held_at_once_and_drives_again(tmp_path: Path) -> None:
    broker = free_port(socket.SOCK_STREAM)
    script = tmp_path / "publisher.py"
    script.write_text(PUBLISHER, "utf-8")
    sources = ({"kind": "zenoh", "listen": f"127.0.0.1:{broker}"},)
    with FarRig(tmp_path, {"cueing": {"algorithm": "classical"}}, sources=sources) as rig:
        rig.wait_for(lambda: rig.shown("planner"), "the planner")
        publisher = subprocess.Popen(
            [sys.executable, str(script), f"tcp/127.0.0.1:{broker}"],
            env=environment(),
            preexec_fn=prompt,
        )
        try:
            rig.engage()
            rig.wait_state("RUN")
            rig.wait_for(rig.is_moving, "motion by zenoh")
            before, began = len(rig.transitions()), time.monotonic()
            os.kill(publisher.pid, signal.SIGSTOP)
            rig.wait_state("HOLD")
            assert time.monotonic() - began < LEASE
            # longer than the lease: the link is gone, and is made anew
            rig.wait_state("PARKED")
            os.kill(publisher.pid, signal.SIGCONT)
            rig.engage()
            rig.wait_state("RUN")
            rig.wait_for(rig.is_moving, "motion again")
            way = rig.transitions()[before:]
            assert [to for _, to in way[:4]] == ["HOLD", "PARKING", "PARKED", "RAISING"]
        finally:
            publisher.kill()
            publisher.wait(PATIENCE)
        rig.wait_state("HOLD", "PARKING", "PARKED")
        assert rig.end() == 0
        verdict = rig.verdict()
    assert_soft(verdict)
