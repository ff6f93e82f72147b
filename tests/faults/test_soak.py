"""Half an hour of driving: no process grows, and ticks come no later than they did.

    pytest -m campaign tests/faults/test_soak.py -s

``MOTION_SOAK_MINUTES`` sets the length. The page is looked at all the while, and something is
tuned every minute. A sentinel on the guard's grid sleeps beside it: what the machine does to the
sentinel is not the guard's doing.
"""

import json
import os
import statistics
import sys
import time
import urllib.request
from pathlib import Path

import pytest
from rig import Rig, assert_soft

from motionserver.evaluate.bench.processes import Helper
from motionserver.evaluate.bench.sentinel import Sentinel
from motionserver.telemetry.histogram import Histogram
from motionserver.telemetry.requests import ask

MINUTES = int(os.environ.get("MOTION_SOAK_MINUTES", "30"))
WARM = 5
"""Minutes in which everything may still grow."""
GROWTH_KB = 1024
PROCESSES = ("guard", "spare", "planner", "web")


def resident_kb(pid: int) -> int:
    status = Path(f"/proc/{pid}/status").read_text("ascii")
    return int(status.partition("VmRSS:")[2].split()[0])


def late(rig: Rig) -> Histogram:
    return Histogram.from_mapping(rig.shown()["tick"]["late_bins"])


def look(rig: Rig) -> None:
    with urllib.request.urlopen(f"http://127.0.0.1:{rig.page_port}/api/status", timeout=10) as seen:
        seen.read()


def tune(rig: Rig, scale: float) -> None:
    version = ask(rig.run_dir / "planner.sock", {"op": "tuning"})["version"]
    changes = {"op": "tune", "if_version": version, "changes": {"scale": scale}}
    assert ask(rig.run_dir / "planner.sock", changes)["ok"]


def minute(rig: Rig, number: int) -> dict[str, float]:
    """Drive for a minute; what it showed."""
    tune(rig, (0.6, 0.5)[number % 2])
    before, period = late(rig), 1.0 / rig.shown()["rates_hz"]["tick"]
    with Sentinel(period, 58.0, 40) as sentinel:
        for _ in range(116):
            look(rig)
            time.sleep(0.5)
        seen = sentinel.late()
    found = late(rig).since(before)
    pids = {name: rig.pid(name) for name in PROCESSES} | {"service": rig.server.pid}
    return {
        "p99_ms": 1e-6 * found.percentile(0.99),
        "sentinel_p99_ms": 1e-6 * seen.percentile(0.99),
        **{f"{name}_kb": resident_kb(pid) for name, pid in pids.items() if pid is not None},
    }


@pytest.mark.campaign
@pytest.mark.timeout(MINUTES * 90 + 300)
def test_nothing_grows_and_nothing_gets_late(tmp_path: Path) -> None:
    minutes: list[dict[str, float]] = []
    with Rig(tmp_path, web=True) as rig:
        rig.run()
        rig.wait_for(lambda: rig.pid("web") and rig.pid("spare"), "page and spare")
        streams = ("motionserver.evaluate.bench.load", str(rig.page_port))
        with Helper(*streams, str(60.0 * MINUTES + 600.0), "0", "2"):
            for number in range(MINUTES):
                minutes.append(minute(rig, number))
                assert rig.state in ("RUN", "HOLD"), rig.story()
                sys.stdout.write(f"{number:3d} {json.dumps(minutes[-1])}\n")
                sys.stdout.flush()
        assert rig.end() == 0
        verdict = rig.verdict()
    assert_soft(verdict)
    settled = minutes[WARM:] if MINUTES > 2 * WARM else minutes
    half = len(settled) // 2
    growth = {
        key: max(one[key] for one in settled) - settled[0][key]
        for key in settled[0]
        if key.endswith("_kb")
    }
    ratios = [one["p99_ms"] / one["sentinel_p99_ms"] for one in settled]
    first, second = statistics.median(ratios[:half]), statistics.median(ratios[half:])
    told = {"growth_kb": growth, "late_p99_over_sentinel": [first, second]}
    sys.stdout.write(f"{json.dumps(told)}\n")
    assert all(kb < GROWTH_KB for kb in growth.values()), growth
    assert second < 1.5 * first, (first, second)
