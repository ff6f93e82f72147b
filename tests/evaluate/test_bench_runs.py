"""Benchmarks in earnest, but for a second: figures are finite and ordered; none is judged."""

import json
import math
import socket
import subprocess

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motionserver.errors import ConfigError
from motionserver.evaluate.bench import command
from motionserver.evaluate.bench.latency import ages, bench_latency, first_changes, loopback_floor
from motionserver.evaluate.bench.loop import bench_loop
from motionserver.evaluate.bench.plan import (
    DEFAULT,
    PlanBench,
    bench_plan,
    headline,
    measure_plan,
    plan_cases,
)
from motionserver.evaluate.bench.plan_accuracy import accuracy_text, measure_accuracy
from motionserver.evaluate.bench.plan_growth import exponent_of, growth_text, measure_growth
from motionserver.evaluate.bench.plan_steps import LIVELY, time_plans
from motionserver.evaluate.bench.processes import BenchError, Helper, free_port
from motionserver.evaluate.bench.report import row_of_samples
from motionserver.evaluate.bench.sentinel import Sentinel
from motionserver.evaluate.bench.server import BenchServer
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


def test_a_server_that_fell_is_said_with_the_end_of_its_log(tmp_path):
    server = BenchServer(60.0, realtime=False)
    (tmp_path / "server.log").write_text("the last word\n")
    port = str(free_port(socket.SOCK_DGRAM))
    base = Helper("motionserver.evaluate.bench.base", port, "60", str(tmp_path / "base.log"))
    fallen = Helper("motionserver", "no-such-command", stderr=subprocess.DEVNULL)
    with base, fallen:
        base.line()
        fallen.process.wait()
        server._folder, server._base, server._server = tmp_path, base, fallen
        with pytest.raises(BenchError, match=r"ended by itself, status 2(?s:.*)the last word"):
            server.stop()
    assert server.verdict["violations"] == 0


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
        times = time_plans(machine, tuning, 5, paced=False)
        rows = times.rows(name)
        assert len(times.period) == 5
        assert_sound(rows[0])
        assert times.outcomes["rejected by guard"] == 0
        assert times.outcomes["no plan"] == 0, name
        assert np.isfinite(times.force_rmse())


def test_where_an_algorithm_tells_its_parts_they_are_rows():
    rows = measure_plan("mpc daqp", 4)["rows"]
    assert {"    linearise", "    fill", "    solve"} <= {row["name"] for row in rows}


def test_the_drive_is_the_same_whether_paced_or_not():
    machine, tuning = load_machine("t2-compact"), plan_cases()["classical"]
    drives = [time_plans(machine, tuning, 8, paced, begin=LIVELY) for paced in (True, False)]
    np.testing.assert_array_equal(drives[0].error, drives[1].error)


def test_kernel_and_sentinel_stand_beside_each_case():
    rows = bench_plan(PlanBench(40, paced=False, only="classical"))
    names = [row.name for row in rows]
    assert names[0] == "classical"
    assert {"  kernel beside it", "  sentinel beside it", "sentinel 100 Hz"} <= set(names)
    for row in rows:
        assert_sound(row)


def test_a_case_that_does_not_exist_is_named():
    with pytest.raises(BenchError, match=r"'quadratic'.*mpc daqp"):
        bench_plan(PlanBench(5, only="quadratic"))


@given(st.floats(0.3, 4.0), st.floats(0.01, 10.0))
def test_a_power_law_is_found(power, factor):
    sizes = (10, 13, 15, 20, 25)
    times = [factor * size**power for size in sizes]
    assert exponent_of(sizes, times) == pytest.approx(power, rel=1e-6)
    assert math.isnan(exponent_of(sizes[:1], times[:1]))


def test_growth_is_measured_and_told():
    found = measure_growth("daqp", 5)
    assert len(found["propose_ms"]) == len(found["solve_ms"]) == len(found["pieces"])
    assert math.isfinite(found["exponent"])
    assert "mpc daqp" in growth_text([found])
    json.dumps(found, allow_nan=False)


def test_exact_backends_drive_like_the_optimum():
    found = measure_accuracy(25, ("piqp", "daqp"))
    piqp, daqp, best = found
    assert best["backend"] == "reference"
    assert piqp["within_bar"]
    assert piqp["first_move_max"] < 1e-3
    assert daqp["first_move_p50"] < 1e-2
    assert "reference" in accuracy_text(found)
    json.dumps(found, allow_nan=False)


def test_the_headline_speaks_of_the_default():
    assert DEFAULT in plan_cases()
    line = headline([row_of_samples(DEFAULT, [2 * MS])])
    assert line == f"default ({DEFAULT}): p99.9 2.00 ms, half a period is 5 ms"
    assert headline([]) == ""


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
    asked = []
    monkeypatch.setattr(command, "bench_plan", lambda what: asked.append(what) or rows)
    monkeypatch.setattr(command, "bench_growth", lambda ticks, backends: [])
    monkeypatch.setattr(command, "bench_accuracy", lambda ticks, backends: [])
    out = tmp_path / "out.json"
    assert command.run_bench("plan", 1.0, out, ticks=7, paced=False) == 0
    assert asked == [PlanBench(7, paced=False)]
    found = json.loads(out.read_text())
    assert found["plan"][0]["max_ms"] == 3.0
    assert found["ticks"] == 7
    assert found["plan_growth"] == found["plan_accuracy"] == []
    assert found["machine"]["cores"] >= 1
    assert "half a period" in capsys.readouterr().out
    assert command.run_bench("plan", 0.5, None, only="classical") == 0
    assert asked[-1] == PlanBench(50, only="classical")


@pytest.mark.parametrize(
    ("what", "seconds", "ticks", "message"),
    [
        ("everything", 1.0, 5, "bench: unknown 'everything'. Allowed: loop, guard, flood"),
        ("plan", 1.0, 0, "--ticks: 0 is out of range. Give 1 to 360000"),
        ("plan", 1.0, 10**6, "--ticks"),
        ("loop", 0.0, None, "--seconds: 0 s is out of range. Give 0.01 to 3600 s"),
        ("loop", math.nan, None, "--seconds"),
    ],
)
def test_the_command_refuses_what_it_cannot_do(what, seconds, ticks, message):
    with pytest.raises(ConfigError, match=message):
        command.run_bench(what, seconds, None, ticks)


def test_figures_that_could_not_be_written_are_not_measured(tmp_path, monkeypatch):
    monkeypatch.setattr(command, "bench_plan", lambda _: pytest.fail("measured"))
    with pytest.raises(ConfigError, match=r"--json .*no file in an existing folder"):
        command.run_bench("plan", 1.0, tmp_path / "nowhere" / "out.json")
