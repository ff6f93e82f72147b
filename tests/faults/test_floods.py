"""A flood at the cue port beside a signed client: what the guard's ticks and the client notice."""

import json
import math
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import pytest
from far_ends import FarRig
from motion_clients.sender import CueSender
from rig import PATIENCE, assert_soft, free_port, prompt

from motionserver.telemetry.histogram import Histogram

KEY = bytes(range(32))
CLIENT_HZ = 100.0


@pytest.fixture(scope="module")
def flooder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A compiled sender: Python does not reach the rate."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler for the sender of the flood")
    program = tmp_path_factory.mktemp("flood") / "flooder"
    source = Path(__file__).with_name("flooder.c")
    subprocess.run([compiler, "-O2", "-Wall", "-o", str(program), str(source)], check=True)
    return program


class Client:
    """A simulator that signs; a context manager that drives meanwhile."""

    def __init__(self, port: int) -> None:
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._send, daemon=True)
        self.sender = CueSender(f"127.0.0.1:{port}", key=KEY)

    def _send(self) -> None:
        prompt()
        begin = time.monotonic()
        tick = 0
        while not self._stop.is_set():
            surge = 2.0 * math.sin(2.0 * (time.monotonic() - begin))
            self.sender.send((surge, 0.5 * surge, 0.0), speed=10.0)
            tick += 1
            time.sleep(max(0.0, begin + tick / CLIENT_HZ - time.monotonic()))

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        self._stop.set()
        self._thread.join(PATIENCE)
        self.sender.close()


class Account:
    """Server's and client's counters of a stretch of time."""

    def __init__(self, rig: FarRig, client: Client) -> None:
        self._rig, self._client = rig, client
        self._began = self._read()

    def _read(self) -> dict[str, Any]:
        guard, planner = self._rig.shown(), self._rig.shown("planner")
        counters = planner["counters"]
        return {
            "sent": self._client.sender.sent,
            "guard": Histogram.from_mapping(guard["tick"]["late_bins"]),
            "planner": Histogram.from_mapping(planner["tick"]["late_bins"]),
            "missed": guard["tick"]["missed"],
            "names": {
                name: counters.get(name, 0)
                for name in ("accepted", "lost_packets", "packets", "refused", "dropped_by_kernel")
            },
        }

    def close(self) -> dict[str, Any]:
        """What happened since."""
        now, then = self._read(), self._began
        told = {name: now["names"][name] - then["names"][name] for name in now["names"]}
        for who in ("guard", "planner"):
            late = now[who].since(then[who])
            told[f"{who}_late_ms"] = {
                name: round(1e-6 * late.percentile(share), 4)
                for name, share in (("p50", 0.5), ("p99", 0.99), ("p999", 0.999))
            }
            told[f"{who}_ticks"] = late.total
        sent = now["sent"] - then["sent"]
        told |= {"sent": sent, "missed": now["missed"] - then["missed"]}
        return told | {"lost_share": told["lost_packets"] / max(1, sent)}


def flood(
    folder: Path, flooder: Path, per_second: int, seconds: float, at: str = "cues"
) -> dict[str, Any]:
    """Idle for so long, then flooded for as long; both accounts, and the base's verdict."""
    port, platform = free_port(), free_port()
    config = {"platform": {"local_port": platform}}
    (folder / "key").write_bytes(KEY)
    (folder / "key").chmod(0o600)
    signed = {"kind": "native", "listen": f"127.0.0.1:{port}", "key_file": str(folder / "key")}
    with FarRig(folder, config, sources=(signed,)) as rig, Client(port) as client:
        rig.engage()
        rig.wait_state("RUN")
        rig.wait_for(rig.is_moving, "motion")
        entered = rig.shown()["counters"]["entered_run"]
        account = Account(rig, client)
        time.sleep(seconds)
        idle = account.close()
        account = Account(rig, client)
        done = subprocess.run(
            [str(flooder), str(port if at == "cues" else platform), str(per_second), str(seconds)],
            capture_output=True,
            text=True,
            check=True,
        )
        # what the client sent last has been read
        time.sleep(0.1)
        flooded = account.close()
        filters = rig.shown("planner")["source"].get("filters")
        assert set(rig.shown("service")["restarts"].values()) == {0}
        holds = rig.shown()["counters"]["entered_run"] - entered
        refusals = rig.text().count("packet refused")
        assert rig.end() == 0
        verdict = rig.verdict()
    count, took = done.stdout.split()
    told = {
        "rate_hz": int(count) / float(took),
        "holds": holds,
        "refusals_logged": refusals,
        "filters": filters,
        "idle": idle,
        "flooded": flooded,
        "violations": verdict["violations"],
        "gap_ms": verdict["gap_ms"],
    }
    sys.stdout.write(f"\nflood of {per_second}/s at the {at}: {json.dumps(told, indent=2)}\n")
    assert_soft(verdict)
    assert refusals < 40
    return told


def test_a_flood_beside_a_signed_client_costs_neither_packets_nor_ticks(
    tmp_path: Path, flooder: Path
) -> None:
    told = flood(tmp_path, flooder, 10_000, 2.0)
    flooded = told["flooded"]
    assert flooded["accepted"] >= 0.95 * flooded["sent"]
    # until the kernel keeps the crowd out one period passes, and some packets with it
    assert flooded["lost_share"] < 0.03
    assert flooded["guard_late_ms"]["p99"] < 1e3 / 240.0


@pytest.mark.campaign
@pytest.mark.parametrize("at", ["cues", "platform"])
def test_a_hundred_thousand_packets_a_second(tmp_path: Path, flooder: Path, at: str) -> None:
    told = flood(tmp_path, flooder, 100_000, 10.0, at)
    if told["rate_hz"] < 95_000.0:
        pytest.skip(f"the machine sends {told['rate_hz']:.0f} packets/s only")
    idle, flooded = told["idle"], told["flooded"]
    assert flooded["lost_share"] < 0.01
    assert flooded["accepted"] >= 0.99 * flooded["sent"] - 5
    assert flooded["guard_late_ms"]["p99"] < idle["guard_late_ms"]["p99"] + 1.0
    assert told["holds"] == 0
