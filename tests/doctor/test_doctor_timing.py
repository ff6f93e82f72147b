"""Lateness to words: what rate is promised, what a stall means, how fine the timers are."""

import re

import pytest

from motionserver.doctor.finding import Level
from motionserver.doctor.timing import (
    Sleep,
    promise,
    stalls,
    tick_rate_of,
    timer_grain,
    wake_up_lateness,
)
from motionserver.telemetry.histogram import Histogram

MS = 1_000_000
FIFO = "SCHED_FIFO 50"


def slept(counts, rate_hz=240.0, scheduling=FIFO):
    """A run of wake-ups: lateness [ms] to how often; slots are lost as the sentinel counts them."""
    late, lost = Histogram(), 0
    for late_ms, count in counts.items():
        lost += count * int(late_ms * 1e-3 * rate_hz)
        for _ in range(count):
            late.add(round(late_ms * MS))
    return Sleep(rate_hz, (late.total + lost) / rate_hz, late, lost, scheduling)


@pytest.mark.parametrize(
    ("packets_hz", "ticks_hz"),
    [(60.0, 240.0), (20.0, 240.0), (100.0, 300.0), (120.0, 240.0), (240.0, 240.0), (250.0, 250.0),
     (1000.0, 1000.0), (59.94, 299.7)],
)  # fmt: skip
def test_the_guard_ticks_at_the_smallest_multiple_of_at_least_240(packets_hz, ticks_hz):
    assert tick_rate_of(packets_hz) == pytest.approx(ticks_hz)


@pytest.mark.parametrize(
    ("counts", "level"),
    [
        ({0.05: 2000}, Level.OK),
        ({0.05: 1990, 3.0: 10}, Level.OK),
        ({0.05: 1990, 3.5: 10}, Level.ADVICE),
        ({0.05: 1999, 20.0: 1}, Level.OK),
        ({0.05: 1990, 6.0: 9}, Level.ADVICE),
        ({0.05: 1980, 5.0: 10}, Level.ADVICE),  # half a percent of the slots, no more
        ({0.05: 1980, 6.0: 20}, Level.WARNING),
        ({0.05: 1800, 5.0: 100}, Level.WARNING),  # five percent, no more
        ({0.05: 1999, 100.0: 1}, Level.WARNING),
        ({0.05: 1890, 6.0: 110}, Level.PROBLEM),
        ({5.0: 2000}, Level.PROBLEM),
    ],
)
def test_lateness_levels(counts, level):
    sleep = slept(counts)
    finding = wake_up_lateness(sleep)
    assert finding.level is level
    assert bool(finding.mend) == (level is not Level.OK)
    assert f"{sleep.lost} of {sleep.late.total + sleep.lost} slots lost" in finding.found
    assert "ms at 240 Hz" in finding.found
    assert FIFO in finding.found


def test_what_mends_lateness_depends_on_the_scheduling():
    late = {0.05: 1980, 6.0: 20}
    assert wake_up_lateness(slept(late)).mend.startswith("motionserver bench")
    normal = wake_up_lateness(slept(late, scheduling="normal scheduling: no permission"))
    assert normal.mend.startswith("mend scheduling class first")


@pytest.mark.parametrize(
    ("counts", "rate_hz", "words"),
    [
        ({0.05: 1990, 0.8: 10}, 480.0, "guard at 480 Hz: p99.9 lateness 0.80 ms of a period of "
         "2.08 ms, fine"),
        ({0.05: 1990, 0.7: 10}, 240.0, "guard at 240 Hz: p99.9 lateness 0.70 ms of a period of "
         "4.17 ms, fine; by wake-ups alone 960 Hz too"),
        ({0.05: 1990, 1.5: 10}, 240.0, "guard at 240 Hz: p99.9 lateness 1.50 ms of a period of "
         "4.17 ms, fine; by wake-ups alone 480 Hz too"),
        ({0.05: 1990, 2.5: 10}, 240.0, "guard at 240 Hz: p99.9 lateness 2.50 ms of a period of "
         "4.17 ms, fine"),
        ({0.05: 990, 2.5: 10}, 240.0, "guard at 240 Hz: p99.9 lateness 2.50 ms of a period of "
         "4.17 ms, fine"),
        ({0.05: 990, 2.5: 9}, 240.0, "guard at 240 Hz: largest lateness 2.50 ms of a period of "
         "4.17 ms, fine"),
        ({0.05: 1990, 3.5: 10}, 240.0, "guard at 240 Hz: p99.9 lateness 3.50 ms of a period of "
         "4.17 ms, fair: a tick in a thousand comes late"),
        ({0.05: 1980, 6.0: 20}, 240.0, "guard at 240 Hz: p99.9 lateness 6.00 ms of a period of "
         "4.17 ms, poor: slots are lost"),
        ({8.0: 2000}, 240.0, "guard at 240 Hz: p99.9 lateness 8.00 ms of a period of 4.17 ms, "
         "not kept"),
    ],
)  # fmt: skip
def test_the_promise(counts, rate_hz, words):
    def without_figure(text):
        return re.sub(r"lateness [\d.]+ ms", "lateness", text)

    said = promise(slept(counts, rate_hz))
    assert without_figure(said) == without_figure(words)
    figure, wanted = (float(re.search(r"lateness ([\d.]+)", t)[1]) for t in (said, words))
    assert figure == pytest.approx(wanted, rel=0.05)


def test_a_stall_that_a_slow_grid_bears_is_no_promise_for_a_fast_one():
    # one wake-up in a hundred 3 ms late: no slot of 4.17 ms lost, three of 1.04 ms each time
    sleep = slept({0.05: 1980, 3.0: 20})
    assert sleep.level_at(240.0) is Level.OK
    assert sleep.level_at(480.0) is Level.WARNING
    assert sleep.level_at(960.0) is Level.WARNING


@pytest.mark.parametrize(
    ("longest_ms", "packets_hz", "level"),
    [
        (4.7, 60.0, Level.OK),
        (6.0, 60.0, Level.ADVICE),
        (30.0, 60.0, Level.ADVICE),
        (36.0, 60.0, Level.WARNING),
        (30.0, 500.0, Level.WARNING),
        (90.0, 60.0, Level.WARNING),
        (110.0, 60.0, Level.PROBLEM),
        (110.0, 20.0, Level.WARNING),
        (320.0, 20.0, Level.PROBLEM),
    ],
)
def test_stall_levels(longest_ms, packets_hz, level):
    finding = stalls(slept({0.05: 1000, longest_ms: 1}), packets_hz)
    assert finding.level is level
    assert bool(finding.mend) == (level is not Level.OK)
    if level is Level.OK:
        assert finding.found.startswith("0 wake-ups later than 5 ms")
    else:
        assert finding.found.startswith("1 wake-up later than 5 ms")
        shown = float(re.search(r"the longest ([\d.]+) ms", finding.found)[1])
        assert shown == pytest.approx(longest_ms, rel=0.05)


@pytest.mark.parametrize(
    ("resolution", "level", "found"),
    [(1e-9, Level.OK, "1 ns"), (1e-6, Level.OK, "1000 ns"), (4e-3, Level.PROBLEM, "4 ms")],
)
def test_timer_grain_levels(resolution, level, found):
    finding = timer_grain(resolution)
    assert (finding.level, finding.found) == (level, found)


def test_figures_for_json_have_units_in_their_names():
    shown = slept({0.05: 990, 6.0: 10}).to_mapping()
    assert shown["ticks"] == 1000
    assert shown["lost"] == 10
    assert shown["stalls"] == 10
    assert shown["late_p50_ms"] == pytest.approx(0.05, rel=0.05)
    assert shown["late_p999_ms"] == pytest.approx(6.0, rel=0.05)
    assert shown["late_max_ms"] == shown["late_p999_ms"]


def test_nothing_watched_promises_nothing_and_breaks_nothing():
    empty = Sleep(240.0, 0.0, Histogram(), 0, FIFO)
    assert empty.stalls == 0
    assert empty.lost_share == 0.0
    assert promise(empty)


def test_the_priorities_are_those_of_guard_and_planner():
    from motionserver.doctor.measure import GUARD_PRIORITY
    from motionserver.doctor.scheduling import PLANNER_PRIORITY
    from motionserver.guard.__main__ import PRIORITY as OF_GUARD
    from motionserver.planner.loop import PRIORITY as OF_PLANNER

    assert (GUARD_PRIORITY, PLANNER_PRIORITY) == (OF_GUARD, OF_PLANNER)
