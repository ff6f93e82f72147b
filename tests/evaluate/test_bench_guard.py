"""The guard's bench: ticks judged by hand-made rows, and short runs of the real thing."""

import math
import os
import socket

import numpy as np
import pytest

from motionserver.evaluate.bench.flood import bench_flood
from motionserver.evaluate.bench.flooder import SIZE, flood
from motionserver.evaluate.bench.guard import bench_guard, ticks_of
from motionserver.evaluate.bench.stalls import StallWatch, overlapping

MS = 1_000_000


def rows(*pairs: tuple[float, float]) -> np.ndarray:
    """Instants and lateness [ms] as [ns]."""
    return np.array([[round(at * MS), round(late * MS)] for at, late in pairs], dtype=np.int64)


NONE = np.empty((0, 2), dtype=np.int64)


def test_lateness_and_lost_slots_by_hand() -> None:
    seen = ticks_of(rows((0, 0), (1.1, 0.1), (3.5, 1.5), (4.0, 0.0), (7.2, 2.2)), 1e6, NONE)
    assert seen.late_ns.tolist() == [100_000, 1_500_000, 0, 2_200_000]
    assert seen.missed.tolist() == [0, 1, 0, 2]
    assert seen.excluded == 0.0
    row = seen.row("x", {})
    assert row.count == 4
    assert row.notes["missed"] == "3 of 7 (42.86%)"


def test_ticks_that_touch_a_stall_are_excluded_and_counted() -> None:
    stalls = np.array([[1.2 * MS, 3.4 * MS]], dtype=np.int64)
    seen = ticks_of(rows((0, 0), (1.1, 0.1), (3.5, 1.5), (4.0, 0.0), (7.2, 2.2)), 1e6, stalls)
    assert seen.stood.tolist() == [False, True, False, False]
    assert seen.excluded == pytest.approx(2 / 7)
    row = seen.row("x", {})
    assert row.count == 3
    assert row.notes["missed"] == "2 of 5 (40.00%)"
    assert row.notes["missed with them"] == 3


def test_spans_and_stalls_at_their_ends() -> None:
    begin, end = np.array([0, 10, 20]), np.array([9, 19, 29])
    for stall, wanted in (
        ((9, 9), [True, False, False]),
        ((9, 10), [True, True, False]),
        ((30, 40), [False, False, False]),
        ((-5, 100), [True, True, True]),
    ):
        assert overlapping(begin, end, np.array([stall])).tolist() == wanted


def test_every_core_is_watched() -> None:
    with StallWatch(0.3) as watch:
        stalls, found = watch.result()
    assert stalls.shape[1] == 2
    assert all(row.count > 0 and row.notes["stalls"] >= 0 for row in found)
    cores = sorted(os.sched_getaffinity(0))
    assert [row.name for row in found] == [f"  core {core} alone" for core in cores]


def test_a_flood_is_as_large_as_it_says() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        link.bind(("127.0.0.1", 0))
        found = flood(link.getsockname()[1], 2000.0, 0.2)
        link.settimeout(5.0)
        heard = [link.recvfrom(4096) for _ in range(int(found["sent"]))]
    assert {len(data) for data, _ in heard} == {SIZE}
    assert len({peer for _, peer in heard}) > 1
    assert 400 <= found["sent"] <= 410


@pytest.mark.timeout(240)
def test_the_guards_bench_of_a_real_server() -> None:
    found = bench_guard(1.0, rates_hz=(250.0,), realtime=(False,))
    names = [row.name for row in found]
    assert names[0] == "guard 250 Hz plain load"
    for row in found:
        cuts = [row.p50_ms, row.p90_ms, row.p99_ms, row.p999_ms, row.max_ms]
        assert cuts == sorted(cuts)
        assert all(map(math.isfinite, cuts))
    assert "HTTP requests/s" in found[0].notes
    assert sum("stalls" in row.notes for row in found) >= 1


@pytest.mark.timeout(240)
def test_a_flood_of_a_real_server() -> None:
    idle, _, cues, _, platform, _ = bench_flood(1.0, realtime=False)
    assert "strangers' packets/s" not in idle.notes
    for row in (cues, platform):
        assert row.notes["dropped in the kernel"] > 0
        assert "client lost" in row.notes
