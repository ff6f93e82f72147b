"""Every way in moves the platform: BeamNG, Zenoh from another process, and the sensor listens."""

import math
import os
import socket
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path

from motion_clients.sender import CueSender
from rig import Rig, assert_soft, environment, free_port, prompt

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
statuses = []
listener = session.declare_subscriber("motion/0/status", lambda _: statuses.append(1))
for sequence in range(100000):
    t = time.monotonic()
    surge = 2.0 * math.sin(2.0 * t)
    motion = Motion((surge, 0.5 * surge, 0.0), (0.0, 0.0, 0.0), speed=10.0)
    publisher.put(encode_cue(Cue(4711, sequence, int(t * 1e9), time.monotonic_ns(), motion)))
    if sequence % 100 == 50:
        print(len(statuses), flush=True)
    time.sleep(0.01)
"""


def motionsim(t: float) -> bytes:
    """88 bytes by hand: x right, y forward, z up; a car that surges forward and back."""
    surge = 2.0 * math.sin(2.0 * t)
    position, velocity = (0.0, 10.0 * t, 0.0), (0.0, 10.0, 0.0)
    acceleration, up = (0.0, surge, 0.0), (0.0, 0.0, 1.0)
    angles, rates, angular = (0.0,) * 3, (0.0,) * 3, (0.0,) * 3
    packet = struct.pack(
        "<4s21f", b"BNG1", *position, *velocity, *acceleration, *up, *angles, *rates, *angular
    )
    assert len(packet) == 88
    return packet


def send_motionsim(port: int, stop: threading.Event) -> None:
    prompt()
    begin = time.monotonic()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        while not stop.is_set():
            link.sendto(motionsim(time.monotonic() - begin), ("127.0.0.1", port))
            time.sleep(1 / 60)


def test_a_game_and_then_zenoh_move_the_platform_and_the_sensor_is_heard(tmp_path: Path) -> None:
    beam, broker = free_port(), free_port(socket.SOCK_STREAM)
    sources = (
        {"kind": "beamng", "listen": f"127.0.0.1:{beam}"},
        {"kind": "zenoh", "listen": f"127.0.0.1:{broker}"},
    )
    script = tmp_path / "publisher.py"
    script.write_text(PUBLISHER, "utf-8")
    config = {"cueing": {"algorithm": "classical"}}
    with Rig(tmp_path, config, sources=sources, imu=True) as rig:
        stop = threading.Event()
        game = threading.Thread(target=send_motionsim, args=(beam, stop), daemon=True)
        game.start()
        rig.engage()
        rig.wait_state("RUN")
        rig.wait_for(rig.is_moving, "motion by the game")
        planner = rig.shown("planner")
        assert planner["source"]["kind"] == "beamng"

        # what an accelerometer on the platform reads has arrived, and the difference is bounded
        rig.wait_for(lambda: rig.shown("planner")["measured_force"] is not None, "the sensor")
        rig.wait_plans(60)
        planner = rig.shown("planner")
        measured, disturbance = planner["measured_force"], planner["disturbance"]
        assert len(measured) == 3
        assert any(x != 0.0 for x in measured)
        assert all(abs(x) < 1.0 for x in disturbance), disturbance
        assert rig.counter("accepted_sensor") > 50

        # the game pauses: it sends nothing, far longer than a lost client is waited for
        stop.set()
        game.join(10.0)
        rig.wait_state("HOLD")
        rig.wait_for(lambda: rig.shown("planner")["source"]["age_s"] > 5.0, "a pause of 5 s")
        assert rig.state == "HOLD"
        assert rig.shown("planner")["source"]["mode"] == "pause"
        stop.clear()
        game = threading.Thread(target=send_motionsim, args=(beam, stop), daemon=True)
        game.start()
        rig.wait_state("RUN")
        stop.set()
        game.join(10.0)
        assert rig.ask("park")["ok"]
        rig.wait_state("PARKED")

        with subprocess.Popen(
            [sys.executable, str(script), f"tcp/127.0.0.1:{broker}"],
            env=environment(),
            stdout=subprocess.PIPE,
            preexec_fn=prompt,
        ) as publisher:
            try:
                rig.engage()
                rig.wait_state("RUN")
                rig.wait_for(rig.is_moving, "motion by zenoh")
                assert rig.shown("planner")["source"]["kind"] == "zenoh"
                assert rig.shown("planner")["source"]["session"] == 4711
                assert publisher.stdout is not None
                os.set_blocking(publisher.stdout.fileno(), True)
                while int(publisher.stdout.readline()) == 0:
                    pass
            finally:
                publisher.kill()
        rig.wait_state("PARKED")
        assert rig.end() == 0
        verdict = rig.verdict()
    assert_soft(verdict)
    assert verdict["speed_max"] > 0.02


def test_a_signed_client_is_answered_and_bye_parks(tmp_path: Path) -> None:
    key = bytes(range(40, 72))
    (tmp_path / "key").write_bytes(key)
    (tmp_path / "key").chmod(0o600)
    signed = free_port()
    sources = (
        {"kind": "native", "listen": f"127.0.0.1:{signed}", "key_file": str(tmp_path / "key")},
    )
    states, stop = [], threading.Event()

    def simulator() -> None:
        prompt()
        with CueSender(f"127.0.0.1:{signed}", key=key) as cue:
            while not stop.is_set():
                cue.send((1.5 * math.sin(2.0 * time.monotonic()), 0.0, 0.0), speed=5.0)
                status = cue.status()
                if status is not None and status.state.name not in states[-1:]:
                    states.append(status.state.name)
                time.sleep(0.01)
            while states[-1:] != ["PARKED"]:
                cue.bye()
                time.sleep(0.05)
                status = cue.status()
                if status is not None:
                    states.append(status.state.name)

    with Rig(tmp_path, sources=sources) as rig:
        thread = threading.Thread(target=simulator, daemon=True)
        thread.start()
        rig.engage()
        rig.wait_state("RUN")
        rig.wait_for(rig.is_moving, "motion")
        rig.wait_for(lambda: "RUN" in states, "the client to be told")
        stop.set()
        rig.wait_state("PARKED")
        thread.join(30.0)
        assert ("RUN", "PARKING") in rig.way()
        assert rig.end() == 0
        verdict = rig.verdict()
    assert_soft(verdict)
    assert states[-1] == "PARKED"
