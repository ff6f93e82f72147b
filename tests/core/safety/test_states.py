"""Every cell of the table, written out by hand from the description of the states."""

import itertools
import re

import pytest

from motionserver.core.safety.states import CUED, RAISED, TABLE, Event, State, after, diagram

# one column per state, "." = stays
COLUMNS = ("OFFLINE", "PARKED", "RAISING", "READY", "RUN", "HOLD", "PARKING", "FAULT", "SAFE")
MATRIX = """
ESTOP           SAFE     SAFE     SAFE     SAFE     SAFE     SAFE     SAFE     SAFE    .
INCONSISTENT    FAULT    .        FAULT    FAULT    FAULT    FAULT    FAULT    .       .
DEVICE_FAULT    FAULT    FAULT    FAULT    FAULT    FAULT    FAULT    FAULT    .       .
FEEDBACK_LOST   .        OFFLINE  FAULT    FAULT    FAULT    FAULT    FAULT    .       .
TRACKING_ERROR  .        .        FAULT    FAULT    FAULT    FAULT    FAULT    .       .
PARK_TIMEOUT    .        .        .        .        .        .        FAULT    .       .
PARK            .        .        PARKING  PARKING  PARKING  PARKING  .        .       .
RAISE_TIMEOUT   .        .        PARKING  .        .        .        .        .       .
HOLD_EXPIRED    .        .        .        .        .        PARKING  .        .       .
SOURCE_SILENT   .        .        .        PARKING  .        .        .        .       .
LOOP_GAP        .        .        .        HOLD     HOLD     .        .        .       .
TROUBLE         .        .        .        .        HOLD     .        .        .       .
DEVICE_DOWN     PARKED   .        .        .        .        .        PARKED   .       .
DEVICE_UP       PARKING  PARKING  .        .        .        .        .        .       .
RAISED          .        .        READY    .        .        .        .        .       .
ENGAGE          .        RAISING  .        .        .        .        .        .       .
CUEING          .        .        .        RUN      .        RUN      .        .       .
RESET_BLIND     .        .        .        .        .        .        .        OFFLINE OFFLINE
RESET_UP        .        .        .        .        .        .        .        PARKING PARKING
RESET_DOWN      .        .        .        .        .        .        .        PARKED  PARKED
"""
ROWS = {line.split()[0]: line.split()[1:] for line in MATRIX.strip().splitlines()}
CELLS = [
    (state, event, state if cell == "." else cell)
    for event, cells in ROWS.items()
    for state, cell in zip(COLUMNS, cells, strict=True)
]


@pytest.mark.parametrize(("state", "event", "follows"), CELLS)
def test_cell(state, event, follows):
    assert after(State[state], Event[event]) is State[follows]


def test_the_matrix_is_whole():
    assert list(ROWS) == [event.name for event in Event]
    assert tuple(state.name for state in State) == COLUMNS
    assert len(CELLS) == len(State) * len(Event) == 180


def pairs():
    return itertools.product(State, Event)


def test_fault_and_safe_are_left_by_an_operator_only():
    for state, event in pairs():
        if state in (State.FAULT, State.SAFE) and after(state, event) not in (state, State.SAFE):
            assert event in (Event.RESET_BLIND, Event.RESET_UP, Event.RESET_DOWN)


def test_reset_matters_in_fault_and_safe_only():
    for state, event in pairs():
        if event.name.startswith("RESET") and state not in (State.FAULT, State.SAFE):
            assert after(state, event) is state


def test_it_runs_from_ready_and_hold_only():
    came = {s for s, e in pairs() if after(s, e) is State.RUN and s is not State.RUN}
    assert came == {State.READY, State.HOLD}


def test_it_is_raised_by_an_engage_from_parked_only():
    cells = [(s, e) for s, e in pairs() if after(s, e) is State.RAISING and s is not State.RAISING]
    assert cells == [(State.PARKED, Event.ENGAGE)]
    assert {s for s, e in pairs() if after(s, e) is State.READY} == {State.RAISING, State.READY}


def test_trouble_upstream_never_faults():
    upstream = {
        Event.PARK,
        Event.RAISE_TIMEOUT,
        Event.HOLD_EXPIRED,
        Event.SOURCE_SILENT,
        Event.LOOP_GAP,
        Event.TROUBLE,
        Event.CUEING,
        Event.ENGAGE,
    }
    for state, event in itertools.product(State, upstream):
        if state is not State.FAULT:
            assert after(state, event) is not State.FAULT


def test_trouble_downstream_faults_every_raised_state():
    downstream = (Event.FEEDBACK_LOST, Event.DEVICE_FAULT, Event.TRACKING_ERROR, Event.INCONSISTENT)
    for state, event in itertools.product(RAISED, downstream):
        assert after(state, event) is State.FAULT
    for state in State:
        assert after(state, Event.ESTOP) is State.SAFE


def test_park_leads_down_from_wherever_it_is_up():
    for state in RAISED:
        assert after(state, Event.PARK) is State.PARKING
    for state in set(State) - RAISED:
        assert after(state, Event.PARK) is state


def test_everything_is_reachable_and_nothing_is_a_trap():
    def reach(start):
        seen, todo = {start}, [start]
        while todo:
            for target in TABLE[todo.pop()].values():
                if target not in seen:
                    seen.add(target)
                    todo.append(target)
        return seen

    for state in State:
        assert reach(state) == set(State)


def test_worst_first():
    order = list(Event)
    assert order[0] is Event.ESTOP
    assert order.index(Event.FEEDBACK_LOST) < order.index(Event.PARK) < order.index(Event.ENGAGE)
    assert order.index(Event.PARK) < order.index(Event.CUEING)
    assert order.index(Event.PARK_TIMEOUT) < order.index(Event.DEVICE_DOWN)
    assert frozenset({State.READY, State.RUN, State.HOLD}) == CUED < RAISED


def test_the_diagram_shows_every_way_and_no_other():
    lines = diagram().splitlines()
    assert lines[:2] == ["stateDiagram-v2", "    [*] --> OFFLINE"]
    drawn = set()
    for line in lines[2:]:
        state, target, why = re.fullmatch(r"    (\w+) --> (\w+) : (.+)", line).groups()
        drawn |= {(state, name.replace(" ", "_").upper(), target) for name in why.split(", ")}
    assert drawn == {cell for cell in CELLS if cell[0] != cell[2]}
