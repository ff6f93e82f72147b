"""Proposals without end against the guard, every emitted setpoint judged by other kinematics.

The whole campaign, a million proposals in twenty blocks of their own seeds; two halves that may
run side by side (``-k west`` and ``-k east``):

    pytest -m campaign tests/core/test_proposals_campaign.py -s

Ten million pieces of cheap junk, forty blocks, genuine plans between them, likewise:

    pytest -m campaign tests/core/test_proposals_campaign.py -s -k junk

With ``MOTION_CAMPAIGN=FILE`` each block appends its figures to FILE and is skipped when they are
already there, so that an interrupted campaign goes on where it stopped.
"""

import json
import os
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from device_model import Bench
from executed import Executed
from junk_proposals import MIX, Junk, faults
from machines import compact
from own_kinematics import quintic_poses
from proposals import Proposer

BLOCK = 50_000
JUNK_BLOCK = 272_728
"""With the genuine plans: forty blocks hold ten million pieces of junk."""
REASONS = (
    "malformed",
    "not-finite",
    "wrong-parent",
    "too-late",
    "too-early",
    "not-at-rest",
    "discontinuous",
    "leg-length",
    "leg-speed",
    "leg-acceleration",
    "leg-jerk",
    "joint-angle",
    "conditioning",
    "no-way-home",
)


def propose_many(seed, count):
    bench = Bench(compact(), plan_period=0.2).engaged()
    bench.plan, bench.plan_every = Proposer(bench.machine, seed), 1
    start = bench.record.counters.copy()
    executed = Executed(bench)
    begin = time.perf_counter()
    for _ in range(count):
        executed.tick()
    assert set(bench.seen[4:]) <= {"RUN", "HOLD"}
    counted = bench.record.counters - start
    shares = {r: counted[f"rejected_{r}"] / count for r in REASONS}
    assert counted["plans_accepted"] + counted["plans_rejected"] == count
    figures = executed.judge(np.random.default_rng(seed).random())
    accepted = counted["plans_accepted"] / count
    seconds = time.perf_counter() - begin
    return {"seed": seed, "count": count, "accepted": accepted, **figures, **shares, "s": seconds}


def hold_to_account(found):
    assert found["legs_off"] < 1e-12
    assert found["pose_off"] < 1e-9
    for rate in ("wire", "fine"):
        assert max(found[rate].values()) <= 1.0, found[rate]
    assert found["accepted"] >= 0.1
    assert {r: found[r] for r in REASONS if found[r] < 0.01} == {}


def test_some_thousand_proposals():
    found = propose_many(seed=7, count=3_000)
    found |= {r: max(found[r], 0.01) for r in REASONS if found[r] > 0.0}
    hold_to_account(found)


@pytest.mark.campaign
@pytest.mark.timeout(0)
@pytest.mark.parametrize("block", [f"{'west' if i < 10 else 'east'}{i:02d}" for i in range(20)])
def test_a_million_proposals(block):
    run_block(1000 + int(block[4:]), propose_many, BLOCK, hold_to_account)


def run_block(seed, propose, count, judge):
    log = os.environ.get("MOTION_CAMPAIGN")
    if log and Path(log).exists():
        done = [json.loads(line)["seed"] for line in Path(log).read_text().splitlines()]
        if seed in done:
            pytest.skip("already in the log")
    found = propose(seed, count)
    line = json.dumps({key: _short(value) for key, value in found.items()})
    sys.stdout.write(line + "\n")
    if log:
        with Path(log).open("a") as file:
            file.write(line + "\n")
    judge(found)


class Followed(Executed):
    """As `Executed`, for plans that follow each other by the ten thousand; none may be illegal."""

    def tick(self):
        newest = self.chain[-1][1]
        playback = self.bench.record.playback
        clock = playback.newest_clock
        super().tick()
        if self.chain[-1][1] is not newest:
            kind, taken = self.bench.plan.kind, self.chain[-1][1]
            wrong = faults(taken, newest, clock)
            assert kind in ("genuine", "maybe"), f"{kind} was taken"
            assert not wrong, f"a plan with wrong {wrong} was taken: {kind}"

    def poses(self, instants):
        starts = np.array([start for start, _ in self.chain])
        edges = [0, *np.searchsorted(instants, starts[1:]), len(instants)]
        pieces = [
            quintic_poses(plan, instants[begin:end] - start)
            for (start, plan), begin, end in zip(self.chain, edges, edges[1:], strict=False)
            if end > begin
        ]
        return np.concatenate(pieces)


def propose_junk(seed, count, slices=0):
    """Junk at every tick; with slices a check takes ten ticks, and so does the next proposal."""
    bench = Bench(compact(), plan_period=0.2, slices=slices).engaged()
    bench.plan, bench.plan_every = Junk(bench.machine, seed), 1
    if slices:
        bench.plan, bench.plan_every = Junk(bench.machine, seed, every=4, lead=0.25), 12
    start = bench.record.counters.copy()
    executed = Followed(bench)
    begin = time.process_time()
    for _ in range(count * bench.plan_every):
        executed.tick()
    junk = bench.plan
    assert set(bench.seen[4:]) <= {"RUN"}
    counted = bench.record.counters - start
    assert counted["plans_accepted"] + counted["plans_rejected"] + junk.unreadable == count
    figures = executed.judge(np.random.default_rng(seed).random())
    accepted = counted["plans_accepted"] / junk.made["genuine"]
    reasons = {key: n for key, n in counted.items() if key.startswith("rejected_")}
    found = {"seed": seed, "count": count, "junk": count - junk.made["genuine"]}
    found |= {"accepted": accepted, "unreadable": junk.unreadable, "made": len(junk.made)}
    return found | figures | reasons | {"s": time.process_time() - begin}


def hold_junk_to_account(found):
    assert found["legs_off"] < 1e-12
    assert found["pose_off"] < 1e-9
    for rate in ("wire", "fine"):
        assert max(found[rate].values()) <= 1.0, found[rate]
    assert found["accepted"] >= 0.5
    assert found["fine"]["speed"] > 0.05
    assert found["made"] == len(MIX) + 1


def test_some_thousand_pieces_of_junk():
    hold_junk_to_account(propose_junk(seed=7, count=5_000))


def test_junk_checked_in_slices():
    hold_junk_to_account(propose_junk(seed=8, count=500, slices=1))


@pytest.mark.campaign
@pytest.mark.timeout(0)
@pytest.mark.parametrize("block", [f"{'west' if i < 20 else 'east'}{i:02d}" for i in range(40)])
def test_ten_million_pieces_of_junk(block):
    run_block(5000 + int(block[4:]), propose_junk, JUNK_BLOCK, hold_junk_to_account)


def _short(value):
    if isinstance(value, dict):
        return {key: _short(item) for key, item in value.items()}
    return round(value, 6) if isinstance(value, float) and value > 1e-3 else value
