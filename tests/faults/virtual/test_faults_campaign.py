"""The whole campaign: every fault with thirty seeds, and two hundred pairs of faults.

Two halves that may run side by side (``-k west`` and ``-k east``):

    MOTION_CAMPAIGN=FILE pytest -m campaign tests/faults/virtual/test_faults_campaign.py

Each scene appends its outcome to FILE and is skipped when it is already there, so that an
interrupted campaign goes on where it stopped; one that failed is not there, and is played again.
``python tests/faults/virtual/table.py FILE`` makes the table of it. MOTION_SCENES=N plays only the
first N seeds and as many pairs for each.
"""

import json
import os
from dataclasses import asdict
from functools import cache
from pathlib import Path

import pytest
from fault_list import FAULTS, FORESEEN
from fault_pairs import pairs_of
from scenario import Scene

SECONDS = 30.0
SEEDS = int(os.environ.get("MOTION_SCENES", "30"))
PAIRS = 200 * SEEDS // 30
MPC_EVERY = 10
LOG = os.environ.get("MOTION_CAMPAIGN")

pytestmark = [pytest.mark.campaign, pytest.mark.timeout(0)]


@cache
def done():
    if not LOG or not Path(LOG).exists():
        return frozenset()
    lines = [json.loads(line) for line in Path(LOG).read_text("utf-8").splitlines()]
    return frozenset((tuple(one["names"]), one["seed"]) for one in lines)


def half(number):
    return "west" if number % 2 else "east"


def play(numbers, seed, **more):
    names = tuple(f"F{n}" for n in numbers)
    if (names, seed) in done():
        pytest.skip("already in the log")
    algorithm = "mpc" if seed % MPC_EVERY == 0 else "classical"
    outcome = Scene([FAULTS[n] for n in numbers], seed, SECONDS, 60.0, algorithm, **more).play()
    refused = ("sent:", "received:") if numbers in FORESEEN else ()
    problems = [text for text in outcome.problems if not text.startswith(refused)]
    assert problems == [], (outcome.names, seed, outcome.states)
    assert outcome.violations == 0 or refused
    if len(numbers) == 1:
        # what masks what is not asked of two: they must be soft, and end safe
        assert outcome.late == [], outcome.states
    if LOG:
        with Path(LOG).open("a", encoding="utf-8") as file:
            file.write(json.dumps(asdict(outcome)) + "\n")


@pytest.mark.parametrize("seed", [100 + i for i in range(SEEDS)])
@pytest.mark.parametrize("number", sorted(FAULTS), ids=lambda n: f"F{n}-{half(n)}")
def test_one_fault(number, seed):
    play((number,), seed)


@pytest.mark.parametrize(
    ("index", "two"),
    list(enumerate(pairs_of(seed=36, count=PAIRS))),
    ids=lambda v: f"F{v[0]}-F{v[1]}" if isinstance(v, tuple) else half(v),
)
def test_two_faults(index, two):
    play(two, 500 + index)
