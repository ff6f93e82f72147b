"""Benchmarks in earnest, but for a second: figures are finite and ordered; none is judged."""

import json
import math

import numpy as np
import pytest

from motionserver.evaluate.bench import command
from motionserver.evaluate.bench.latency import ages, bench_latency, first_changes, loopback_floor
from motionserver.evaluate.bench.loop import bench_loop
from motionserver.evaluate.bench.plan import DEFAULT, headline, plan_cases
from motionserver.evaluate.bench.plan_steps import PERIOD, time_plans
from motionserver.evaluate.bench.processes import BenchError, Helper
from motionserver.evaluate.bench.report import row_of_samples
from motionserver.evaluate.bench.sentinel import Sentinel
from motionserver.settings.machine import load_machine

MS = 1_000_000


def assert_sound(row):
    cuts = [row.p50_ms, row.p90_ms, row.p99_ms, row.p999_ms, row.max_ms]
    assert row.count > 0, row.name
    assert cuts == sorted(cuts), row.name
    assert all(math.isfinite(cut) and cut >= 0.0 for cut in cuts), row.name


def test_the_sentinel_sleeps_and_tells():
    with Sentinel(0.005, 0.3, 0) as sentinel:
        row = sentinel.row("sentinel")
    assert_sound(row)
    assert row.notes["scheduling"] == "normal scheduling, as configured"


def test_a_process_that_says_nothing_is_an_error(capfd):
    helper = Helper("motionserver.evaluate.bench.sentinel", "no", "numbers", "here")
    with helper, pytest.raises(BenchError, match="said nothing"):
        helper.line()
    assert "ValueError" in capfd.readouterr().err


@pytest.mark.timeout(240)
def test_lateness_of_a_real_server_idle_and_loaded():
    rows = bench_loop(1.0, rates_hz=(60.0,), realtime=(False,))
    assert len(rows) == 8
    for row in rows:
        assert_sound(row)
    assert sum("HTTP requests/s" in row.notes for row in rows) == 1


@pytest.mark.timeout(240)
def test_latency_of_a_real_server():
    for row in bench_latency(2.0):
        assert_sound(row)


def test_every_case_of_the_plan_benchmark_runs():
    machine = load_machine("t2-compact")
    for name, tuning in plan_cases().items():
        times = time_plans(machine, tuning, 5 * PERIOD)
        rows = times.rows(name)
        assert len(times.period) == 5
        assert_sound(rows[0])
        assert times.outcomes["rejected by guard"] == 0


def test_the_headline_speaks_of_the_default():
    assert DEFAULT in plan_cases()
    line = headline([row_of_samples(DEFAULT, [2 * MS])])
    assert line == "default with leg rows: p99.9 2.00 ms, half a period is 5 ms"


def test_loopback_alone():
    assert_sound(loopback_floor(0.5))


def moving(count, change_row, size):
    """Legs on a slow parabola that jump away from it at a row, as a new plan makes them."""
    time = np.arange(count) / 60.0
    legs = np.outer(0.01 * time**2, np.ones(6))
    legs[change_row:, 2] += size * (np.arange(count - change_row) + 1.0) ** 2
    return legs


def test_the_first_changed_setpoint_is_found_on_a_moving_platform():
    arrivals = np.arange(40) * 16 * MS
    legs = moving(40, 22, 2e-5)
    assert first_changes(arrivals, legs, [20 * 16 * MS + 3]) == [22]


def test_a_step_that_changes_nothing_is_not_found():
    arrivals = np.arange(40) * 16 * MS
    assert first_changes(arrivals, moving(40, 22, 0.0), [20 * 16 * MS + 3]) == [None]


def test_a_step_before_the_platform_was_seen_is_not_found():
    arrivals = np.arange(40) * 16 * MS
    assert first_changes(arrivals, moving(40, 5, 2e-5), [3 * 16 * MS]) == [None]


def test_the_age_is_that_of_the_newest_cue_that_could_be_in_it():
    sent = np.array([0, 10, 20, 30]) * MS
    arrivals = np.array([4, 15, 26, 45]) * MS
    # 5 ms on the way: the first set-point can hold none
    np.testing.assert_array_equal(ages(arrivals, sent, 5 * MS), np.array([5, 6, 15]) * MS)


def test_the_command_writes_what_it_prints(tmp_path, capsys, monkeypatch):
    rows = [row_of_samples(DEFAULT, [2 * MS, 3 * MS])]
    monkeypatch.setattr(command, "_MEASURES", {"plan": lambda seconds: rows})
    assert command.run_bench("all", 1.0, tmp_path / "out.json") == 0
    out = json.loads((tmp_path / "out.json").read_text())
    assert out["plan"][0]["max_ms"] == 3.0
    assert out["machine"]["cores"] >= 1
    assert "half a period" in capsys.readouterr().out


def test_the_command_refuses_what_it_does_not_know():
    with pytest.raises(ValueError, match="allowed are loop, plan, latency or all"):
        command.run_bench("everything", 1.0, None)
