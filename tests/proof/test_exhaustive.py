"""Every state of the guard, every thing that can happen in it, on the guard's own functions.

The hostile world does what it likes: the device may say anything in each tick. The sound world
has a base that obeys; there, nothing that client, planner or operator do may end in a fault. All
combinations at once, in place of the chosen ones, take about an hour:

    pytest -m campaign tests/proof/test_exhaustive.py -s
"""

from collections import Counter

import pytest
from coarse_guard import CoarseGuard, Given
from explore import DOWN, PAIRS, UP, Broken, Explorer, everything, hostile, rules
from guard_scenes import in_state

from motionserver.core.device import Order, Phase
from motionserver.core.safety.states import CUED, RAISED, TABLE, Event, State
from motionserver.core.safety.supervisor import is_standing

LATCHED = (State.FAULT, State.SAFE)
STILL_ORDERS = (Order.WAIT, Order.PARK)


WAYS = {("down", Order.RAISE): "raising", ("up", Order.PARK): "lowering"}
LATER = {"raising": "up", "lowering": "down"}


def obeyed(phase, order):
    """Where a sound base is one tick after an order."""
    return LATER.get(phase) or WAYS.get((phase, order), phase)


def said(phase):
    """What a sound base says, in the words of the coarse guard."""
    return f"{phase} {'low' if phase == 'down' else 'told'}"


def ends(explorer, node, phase, words=None, most=60):
    """Let time pass with a silent client and nobody at the console, until nothing changes.

    ``words``: what the device says for ever; None for a sound base that is in ``phase``.
    """
    coarse, seen, last = explorer.coarse, set(), None
    for _ in range(most):
        key = (coarse.sign(node), phase)
        if key in seen:
            return State(node.record[0]), last, node
        seen.add(key)
        setpoint, _ = coarse.tick(node, Given(words or said(phase)))
        last = setpoint.order
        node = coarse.node(node.now + 1_000_000_000, node.engaged, node.asked)
        phase = obeyed(phase, last)
    raise Broken(f"does not end: {node.record[0]}")


def check_ends(explorer):
    """From wherever a hostile world led: trouble that lasts ends still, peace ends parked."""
    counted = Counter()
    for node in list(explorer.found.values()):
        for words in ("silent", "up told fault", "up told estop", "up told fault estop"):
            state, order, last = ends(explorer, node, "up", words)
            if order not in STILL_ORDERS or not is_standing(last.record[2]) or state in RAISED:
                raise Broken(f"{words} for ever ends in {state}, {order}")
            counted[words, state.value] += 1
        for phase in ("up",) if node.record[0] in CUED else ("up", "down"):
            state, order, last = ends(explorer, node, phase)
            if state not in (State.PARKED, *LATCHED) or not is_standing(last.record[2]):
                raise Broken(f"silence ends in {state}, {order}")
            is_up = state is State.FAULT and last.device[0].phase is not Phase.DOWN
            # to park by itself it was sent no place: where the base then stands is its own affair
            if is_up and "mm from where it was sent" not in last.decision[4]:
                raise Broken(f"a fault leaves it up: {last.decision}")
            counted["peace, elsewhere" if is_up else "peace", state.value] += 1
    return counted


def explore_sound(coarse):
    """The sound world: the base's phase is part of the state; (nodes, transitions)."""
    explorer = Explorer(coarse, rules)
    start = (coarse.first, "down")
    found = {(coarse.sign(coarse.first), "down"): start}
    todo = [start]
    for node, phase in todo:
        choices = [Given(said(phase), *pair) for pair in PAIRS]
        choices += [Given(said(phase), "drive", "moves", op) for op in ("engage", "park", "reset")]
        if node.record[0] is not State.PARKING:
            # a gap while parking: test_a_gap_while_parking_is_no_fault
            choices += [Given(said(phase), "drive", "moves", "none", gap) for gap in (2, 3)]
        for given in choices:
            after = explorer.step(node, given)
            state = after.record[0]
            if state in LATCHED:
                raise Broken(f"upstream trouble faults: {node.record[0]} {given}")
            order = coarse.last_order
            follows = obeyed(phase, order)
            key = (coarse.sign(after), follows)
            if key not in found:
                found[key] = (after, follows)
                todo.append((after, follows))
    for node, phase in todo:
        state, order, _ = ends(explorer, node, phase)
        if state is not State.PARKED or order is not Order.WAIT:
            raise Broken(f"a silent client ends in {state}, {order}")
    return explorer, len(found)


def tell(name, states, explorer):
    print(f"{name}: {states} states, {explorer.transitions} transitions")


def test_a_hostile_world(monkeypatch):
    coarse = CoarseGuard(monkeypatch)
    explorer = Explorer(coarse, rules, most=20_000).explore(coarse.first, hostile)
    tell("hostile world", len(explorer.found), explorer)
    # every cell of the table that leads somewhere was taken, whatever event led there
    ways = {(a.value, b.value) for a in State for b in TABLE[a].values()}
    assert set(explorer.edges) == ways
    assert {state for state, *_ in explorer.found} == set(State)


def test_trouble_that_lasts_ends_still_and_peace_ends_parked(monkeypatch):
    coarse = CoarseGuard(monkeypatch)
    few = Explorer(coarse, rules).explore(coarse.first, brief)
    counted = check_ends(few)
    print(dict(sorted(counted.items())))
    assert counted["peace", "FAULT"] > 10 * counted["peace, elsewhere", "FAULT"]


def brief(node):
    """A small hostile world, for what is asked of each of its states."""
    for device in ("silent", DOWN, UP, "up told fault", "up told estop"):
        yield Given(device, "drive", "moves")
    for operator in ("engage", "park", "reset"):
        for device in (UP, DOWN):
            yield Given(device, "drive", "moves", operator)
    yield Given(UP, "none", "none")
    yield Given(UP, "pause", "moves")


def test_a_sound_base_is_never_faulted(monkeypatch):
    explorer, states = explore_sound(CoarseGuard(monkeypatch, lowering=3.0, raising=2.5))
    tell("sound world", states, explorer)
    reached = {b for _, b in explorer.edges}
    assert reached == {state.value for state in State} - {"FAULT", "SAFE", "OFFLINE"}


def test_a_gap_while_parking_is_no_fault():
    b = in_state("PARKING")
    b.tick(gap_ns=30_000_000_000)
    b.run(0.1)
    assert b.state == "PARKING", b.record.reason


WRONG = {
    "a fault heals itself": (State.FAULT, Event.DEVICE_DOWN, State.PARKED),
    "a stop runs": (State.SAFE, Event.DEVICE_UP, State.RUN),
    "a reset raises": (State.FAULT, Event.RESET_UP, State.RAISING),
    "parked raises itself": (State.PARKED, Event.DEVICE_DOWN, State.RAISING),
    "a stop is ignored": (State.RAISING, Event.ESTOP, State.RAISING),
    "a device fault is ignored": (State.RUN, Event.DEVICE_FAULT, State.RUN),
    "a silent device is ignored": (State.READY, Event.FEEDBACK_LOST, State.READY),
    "park is refused": (State.RUN, Event.PARK, State.RUN),
    "a lost source goes on": (State.RUN, Event.TROUBLE, State.RUN),
    "parked while up": (State.PARKING, Event.DEVICE_UP, State.PARKED),
    "run from parking": (State.PARKING, Event.DEVICE_UP, State.RUN),
}


@pytest.mark.parametrize(
    "name",
    [n if i % 3 == 0 else pytest.param(n, marks=pytest.mark.campaign) for i, n in enumerate(WRONG)],
)
def test_a_wrong_cell_is_noticed(monkeypatch, name):
    state, event, target = WRONG[name]
    monkeypatch.setitem(TABLE, state, {**TABLE[state], event: target})
    coarse = CoarseGuard(monkeypatch)
    with pytest.raises(Broken):
        Explorer(coarse, rules).explore(coarse.first, hostile)


@pytest.mark.parametrize(
    ("state", "event", "target"),
    [
        (State.HOLD, Event.HOLD_EXPIRED, State.HOLD),
        (State.READY, Event.SOURCE_SILENT, State.READY),
        (State.RUN, Event.TROUBLE, State.FAULT),
        (State.PARKING, Event.DEVICE_DOWN, State.PARKING),
    ],
)
def test_what_never_ends_is_noticed(monkeypatch, state, event, target):
    monkeypatch.setitem(TABLE, state, {**TABLE[state], event: target})
    with pytest.raises(Broken):
        explore_sound(CoarseGuard(monkeypatch, lowering=3.0, raising=2.5))


@pytest.mark.campaign
@pytest.mark.timeout(0)
def test_everything_at_once(monkeypatch):
    coarse = CoarseGuard(monkeypatch)
    explorer = Explorer(coarse, rules).explore(coarse.first, everything)
    tell("everything", len(explorer.found), explorer)
    print(dict(sorted(check_ends(explorer).items())))
