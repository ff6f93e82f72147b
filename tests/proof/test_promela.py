"""The exported table holds in SPIN, and SPIN notices when a cell of it is wrong."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from motionserver.core.safety.states import TABLE, Event, State
from motionserver.evaluate.proof.promela import CLAIMS, promela

ROOT = Path(__file__).parents[2]
COMPILER = shutil.which("cc") or shutil.which("gcc")
needs_spin = pytest.mark.skipif(
    shutil.which("spin") is None or COMPILER is None,
    reason="model checking needs spin and a C compiler (apt-get install spin gcc); the same "
    "invariants are enumerated in test_exhaustive.py without them",
)

# a cell changed -> whatever must notice
MUTANTS = {
    "a fault heals itself": (State.FAULT, Event.DEVICE_DOWN, State.PARKED),
    "a stop heals itself": (State.SAFE, Event.CUEING, State.RUN),
    "a stop is a fault once the source talks": (State.SAFE, Event.TROUBLE, State.PARKING),
    "a reset runs": (State.FAULT, Event.RESET_UP, State.RUN),
    "a reset raises": (State.SAFE, Event.RESET_DOWN, State.RAISING),
    "parked runs": (State.PARKED, Event.CUEING, State.RUN),
    "parked raises by itself": (State.PARKED, Event.CUEING, State.RAISING),
    "parked while up": (State.PARKING, Event.DEVICE_UP, State.PARKED),
    "offline is parked while up": (State.OFFLINE, Event.DEVICE_UP, State.PARKED),
    "a stop is ignored in RUN": (State.RUN, Event.ESTOP, State.RUN),
    "a stop is ignored in PARKED": (State.PARKED, Event.ESTOP, State.PARKED),
    "a stop parks": (State.RAISING, Event.ESTOP, State.PARKING),
    "a device fault is held": (State.RUN, Event.DEVICE_FAULT, State.HOLD),
    "a device fault is ignored while parking": (State.PARKING, Event.DEVICE_FAULT, State.PARKING),
    "silence of the device is held": (State.READY, Event.FEEDBACK_LOST, State.HOLD),
    "silence of the device parks": (State.RUN, Event.FEEDBACK_LOST, State.PARKING),
    "what does not follow is held": (State.RUN, Event.TRACKING_ERROR, State.HOLD),
    "trouble upstream faults": (State.RUN, Event.TROUBLE, State.FAULT),
    "a lost source goes on": (State.RUN, Event.TROUBLE, State.RUN),
    "a gap stops": (State.RUN, Event.LOOP_GAP, State.SAFE),
    "park is refused in READY": (State.READY, Event.PARK, State.READY),
    "park only holds": (State.RUN, Event.PARK, State.HOLD),
    "a hold never ends": (State.HOLD, Event.HOLD_EXPIRED, State.HOLD),
    "ready waits for ever": (State.READY, Event.SOURCE_SILENT, State.READY),
    "parking never ends": (State.PARKING, Event.DEVICE_DOWN, State.PARKING),
    "raised is run at once": (State.RAISING, Event.RAISED, State.RUN),
    "ready without being up": (State.RAISING, Event.TROUBLE, State.READY),
    "offline runs": (State.OFFLINE, Event.DEVICE_UP, State.HOLD),
    "parking cues again": (State.PARKING, Event.CUEING, State.READY),
}


def compiled(folder, table=TABLE):
    (folder / "states.pml").write_text(promela(table), "ascii")
    for command in (("spin", "-a", "states.pml"), (COMPILER, "-O1", "-w", "-o", "pan", "pan.c")):
        subprocess.run(command, cwd=folder, check=True, capture_output=True, timeout=120)


def errors(folder, claim):
    """How many errors a run for one claim, and for all asserts, finds; states and transitions."""
    ran = subprocess.run(
        ("./pan", "-a", "-m1000000", "-N", claim),
        cwd=folder,
        check=False,
        capture_output=True,
        text=True,
        timeout=120,
    )
    found = re.search(r"errors: (\d+)", ran.stdout)
    assert found, ran.stdout + ran.stderr
    assert "max search depth too small" not in ran.stdout
    states = re.search(r"(\d+) states, stored", ran.stdout)
    transitions = re.search(r"(\d+) transitions", ran.stdout)
    return int(found[1]), int(states[1]), int(transitions[1])


def noticed(folder, table):
    compiled(folder, table)
    return [claim for claim in CLAIMS if errors(folder, claim)[0]]


def with_cell(state, event, target):
    table = {one: dict(row) for one, row in TABLE.items()}
    table[state][event] = target
    return table


def test_every_cell_is_exported_in_order():
    cells = re.findall(
        r"state == (\w+) && event == NONE && h_(\w+) ->\s+event = E_(\w+); next = (\w+)", promela()
    )
    assert [(a, b, d) for a, b, _, d in cells] == [
        (state.name, event.name, TABLE[state][event].name)
        for state in State
        for event in Event
        if TABLE[state].get(event, state) is not state
    ]
    assert all(b == c for _, b, c, _ in cells)


def test_the_command_prints_the_model():
    ran = subprocess.run(
        (sys.executable, "-m", "motionserver.evaluate.proof"),
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert ran.stdout == promela()


@needs_spin
def test_the_table_holds(tmp_path):
    compiled(tmp_path)
    for claim in CLAIMS:
        found, states, transitions = errors(tmp_path, claim)
        print(f"{claim}: {states} states, {transitions} transitions, {found} errors")
        assert found == 0, claim
        assert states > 50


@needs_spin
@pytest.mark.parametrize(
    ("way", "wrong"),
    [
        ("     :: else -> order = SETTLES", "     :: else -> order = WAITS"),
    ],
)
def test_a_fault_that_leaves_people_up_is_noticed(tmp_path, monkeypatch, way, wrong):
    whole = promela()
    assert whole.count(way) == 1
    monkeypatch.setitem(globals(), "promela", lambda _: whole.replace(way, wrong))
    compiled(tmp_path)
    assert any(errors(tmp_path, claim)[0] for claim in CLAIMS)


@needs_spin
@pytest.mark.parametrize("name", ["a fault heals itself", "a hold never ends"])
def test_a_wrong_cell_is_noticed(tmp_path, name):
    compiled(tmp_path, with_cell(*MUTANTS[name]))
    assert any(errors(tmp_path, claim)[0] for claim in CLAIMS)


@needs_spin
@pytest.mark.campaign
@pytest.mark.parametrize("name", MUTANTS)
def test_every_wrong_cell_is_noticed(tmp_path, name):
    found = noticed(tmp_path, with_cell(*MUTANTS[name]))
    print(f"{name}: {found}")
    assert found
