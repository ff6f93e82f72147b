"""A guard that checks in slices: what it plays keeps every limit, and every proposal is counted."""

import numpy as np
import pytest
from device_model import Bench
from executed import Executed
from guard_scenes import legal
from machines import compact
from proposals import Proposer


@pytest.mark.parametrize(("slices", "every"), [(1, 1), (2, 5), (4, 3), (3, 12)])
def test_what_is_played_keeps_every_limit_whatever_is_proposed_meanwhile(slices, every):
    bench = Bench(compact(), plan_period=0.2, slices=slices).engaged()
    propose, count = Proposer(bench.machine, slices), 0

    def counted(playback):
        nonlocal count
        count += 1
        return propose(playback)

    start = bench.record.counters.copy()
    bench.plan, bench.plan_every = counted, every
    executed = Executed(bench)
    for _ in range(3000):
        executed.tick()
    bench.planning = False
    for _ in range(20):
        executed.tick()
    assert not bench.guard.is_checking
    found = bench.record.counters - start
    told = found["plans_accepted"] + found["plans_rejected"] + found["plans_overtaken"]
    # one of before the start may have ended after it
    assert count <= told <= count + 2
    assert found["plans_accepted"] > 10
    assert (found["plans_overtaken"] > 100) == (every == 1)
    figures = executed.judge(np.random.default_rng(slices).random())
    assert figures["legs_off"] < 1e-12
    assert figures["pose_off"] < 1e-9
    for rate in ("wire", "fine"):
        assert max(figures[rate].values()) <= 1.0


def test_an_ordinary_drive_runs_and_parks_as_ever():
    bench = Bench(compact(), slices=2).engaged()
    bench.run(3.0)
    assert bench.state == "RUN"
    assert bench.record.counters["plans_accepted"] > 50
    bench.tick("park")
    bench.until("PARKED", 20.0)
    legal(bench)


def test_the_verdict_is_told_in_the_tick_it_is_given():
    bench = Bench(compact(), slices=1).engaged()
    bench.plan_every, accepted, rejected = 24, 0, 0
    bench.run(0.5)
    for _ in range(240):
        before = bench.record.counters.copy()
        bench.tick()
        more = bench.record.counters - before
        told = more["plans_accepted"] + more["plans_rejected"]
        assert told == (bench.guard.judged is not None)
        if more["plans_accepted"]:
            assert bench.record.playback.newest.plan is bench.guard.judged
        accepted, rejected = accepted + more["plans_accepted"], rejected + more["plans_rejected"]
    assert 8 <= accepted + rejected <= 11


def test_without_slices_a_proposal_is_judged_at_once():
    bench = Bench(compact()).engaged()
    for _ in range(30):
        bench.tick()
        assert not bench.guard.is_checking
        assert (bench.guard.judged is not None) == (bench.ticks % bench.plan_every == 0)
    assert "plans_overtaken" not in bench.record.counters
