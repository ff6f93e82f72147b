"""The table of motion states in Promela, with a world around it and what must hold.

States, events, their order and every cell come from `motionserver.core.safety.states`. The world
is as hostile as it can be: device, source, planner, operator and every timer do what they like in
each tick. Only what must *end* well needs more: from some tick on the world may be calm (the
source silent, the device healthy and obedient, no operator), and then timers run out in order.

To check it::

    python -m motionserver.evaluate.proof > states.pml
    spin -a states.pml && cc -O1 -o pan pan.c
    ./pan -a -N silence_parks        # one run for each claim; see `CLAIMS`
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from motionserver.core.safety.states import CUED, RAISED, TABLE, Event, State

CLAIMS: Final = {
    "stands_in_the_end": "[] (([] trouble) -> <> [] !moving)",
    "silence_parks": "[] ((calm && !latched) -> <> [] (state == PARKED))",
    "a_fault_comes_down": "[] ((calm && state == FAULT) -> <> [] (phase == DOWN))",
}
"""What must hold, by name, in linear temporal logic over the words of the model."""

_WORLD: Final = """\
#define DOWN 0
#define BETWEEN 1
#define UP 2
#define SILENT 0
#define PAUSES 1
#define DRIVES 2
#define WAITS 0
#define FOLLOWS 1
#define SETTLES 2
#define latched (state == FAULT || state == SAFE)
#define moving (raised || (state == FAULT && !standing))

byte state = OFFLINE;
byte phase = DOWN;
byte age = 0;
/* ticks without a fault and without a break, and what the device was told last */
byte sound = 0, order = WAITS;
bit standing = 1, neutral = 1, calm = 0, trouble = 0, asked = 0, engaged = 0;

/* what is of this tick only, and forgotten after it */
byte source, next, event;
bit lost, estop, fault, astray, broken, valid, planned, gap, park_wish, engage_wish, late;

inline any(x) { if :: x = 0 :: x = 1 fi }

inline hostile() {
  if
  :: lost = 1
  :: if :: phase = DOWN :: phase = BETWEEN :: phase = UP fi;
     if :: valid = 1 :: skip :: estop = 1 :: fault = 1 :: estop = 1; fault = 1 fi
  fi;
  if :: skip :: astray = 1 :: broken = 1 fi;
  if
  :: source = SILENT
  :: source = PAUSES; planned = 1
  :: source = DRIVES
  :: source = DRIVES; planned = 1
  fi;
  any(gap); any(park_wish); any(late);
  if :: state == PARKED -> any(engage_wish) :: else -> skip fi;
  if :: latched && standing -> asked = 1 :: asked -> asked = 0 :: skip fi
}

inline peaceful() {
  valid = 1; source = SILENT;
  if
  :: cued -> phase = UP
  :: state == RAISING && phase < UP -> phase++
  :: state == PARKING && standing && phase > DOWN -> phase--
  :: (state == PARKED || state == OFFLINE) && phase == BETWEEN -> phase = DOWN
  /* in a fault it obeys as ever: it settles when it is told to, and lifts to the end if it does */
  :: state == FAULT && order == SETTLES && phase > DOWN -> phase--
  :: state == FAULT && order != SETTLES && phase == BETWEEN -> phase = UP
  :: else -> skip
  fi;
  late = ((state == RAISING && age >= 4) || (state == PARKING && age >= 7)
      || (state == HOLD && age >= 2) || (state == READY && age >= 3))
}

inline notice() {
  h_INCONSISTENT = broken;
  h_TRACKING_ERROR = astray;
  h_LOOP_GAP = gap;
  h_FEEDBACK_LOST = lost;
  h_RESET_BLIND = lost && asked && standing;
  h_ESTOP = estop;
  h_DEVICE_FAULT = fault || (!lost && cued && phase != UP);
  valid = valid && !h_DEVICE_FAULT;
  h_RESET_DOWN = valid && asked && standing && phase == DOWN;
  h_RESET_UP = valid && asked && standing && phase == UP;
  h_DEVICE_DOWN = valid && phase == DOWN && (state != PARKING || standing);
  h_DEVICE_UP = valid && phase == UP;
  h_RAISED = valid && phase == UP;
  h_PARK = park_wish;
  h_TROUBLE = source == SILENT || source == PAUSES || !planned;
  h_CUEING = source == DRIVES && planned;
  h_HOLD_EXPIRED = state == HOLD && late;
  h_SOURCE_SILENT = source == SILENT && late;
  h_RAISE_TIMEOUT = state == RAISING && late;
  h_PARK_TIMEOUT = state == PARKING && late;
  h_ENGAGE = engage_wish && state == PARKED && !lost && phase == DOWN && source != SILENT;
  trouble = lost || estop || fault
}

#define is_reset (event == E_RESET_BLIND || event == E_RESET_UP || event == E_RESET_DOWN)

/* what is sent in a fault: see core.safety.fault_return */
inline come_down() {
  sound = ((lost || fault || estop) -> 0 : (sound < 2 -> sound + 1 : sound));
  if
  :: next != FAULT -> order = WAITS
  :: next == FAULT && !standing -> order = FOLLOWS
  :: next == FAULT && standing && fault -> order = SETTLES
  :: next == FAULT && standing && !fault && (sound < 2 || phase == DOWN || astray) -> order = WAITS
  :: next == FAULT && standing && !fault && sound == 2 && phase != DOWN && !astray ->
     if
     :: phase == UP && !neutral -> order = FOLLOWS; standing = 0; neutral = 1
     :: else -> order = SETTLES
     fi
  fi;
  /* who is silent or faulty is not moved anew; a stop is never played against */
  assert(order != FOLLOWS || next == FAULT);
  assert(order == WAITS || !estop);
  assert(order != SETTLES || !lost)
}

inline account() {
  /* FAULT and SAFE are left by an operator's edge only, but that a stop is followed in a fault */
  assert(next == state || !latched || (asked && is_reset) || (estop && next == SAFE));
  /* it runs from READY and HOLD only, with a source that drives, plans, and a sound device */
  assert(next != RUN || state == READY || state == HOLD || state == RUN);
  assert(next != RUN || (source == DRIVES && planned));
  assert(next != RUN || (!trouble && phase == UP && !astray && !broken));
  /* it is raised by an operator's edge from PARKED only */
  assert(next != RAISING || state == RAISING || (state == PARKED && engage_wish));
  assert(next != READY || state == READY || (state == RAISING && phase == UP));
  /* who is parked is down */
  assert(next != PARKED || state == PARKED || phase == DOWN);
  assert(next != PARKED || lost || valid == 0 || phase != UP);
  /* an open stop, a fault and a silent device leave nothing that cues, raises or parks */
  assert(!estop || next == SAFE);
  assert(!fault || next == SAFE || next == FAULT);
  assert(!lost || !(next == RAISING || next == READY || next == RUN || next == HOLD
                    || next == PARKING));
  assert(!(astray || broken) || !(next == RUN || next == HOLD || next == READY));
  /* trouble upstream never faults */
  assert(next == state || next != FAULT || trouble || astray || broken
         || event == E_PARK_TIMEOUT || (cued && phase != UP));
  assert(next == state || next != SAFE || estop);
  /* park is always granted */
  assert(!h_PARK || !(next == RAISING || next == READY || next == RUN || next == HOLD)
         || state == PARKED);
  if
  :: next == state -> age = ((calm || state == FAULT) && age < 7 -> age + 1 : age)
  :: else ->
     age = 0; asked = 0;
     engaged = (next == RAISING -> 1 : (engaged && (next == READY || next == RUN || next == HOLD)))
  fi;
  if
  :: next == RAISING || next == PARKED || next == OFFLINE || next == SAFE -> standing = 1
  :: next == READY || next == RUN || next == HOLD -> any(standing)
  /* a plan ends: what is accepted plays to its rest, then it stands */
  :: next == FAULT && standing -> skip
  :: next == FAULT && !standing -> if :: standing = 1 :: age < 3 -> skip fi
  :: next == PARKING && next == state && calm -> standing = 1
  :: next == PARKING && !(next == state && calm) -> any(standing)
  fi;
  /* who is up was engaged */
  assert(engaged || !(next == READY || next == RUN || next == HOLD));
  if
  :: next == RAISING || next == PARKED || next == OFFLINE || next == SAFE -> neutral = 1
  :: next == READY || next == RUN || next == HOLD || next == PARKING -> any(neutral)
  :: next == FAULT -> skip
  fi;
  come_down();
  /* a calm world faults nobody */
  assert(!calm || latched || !(next == FAULT || next == SAFE));
  state = next
}

inline forget() {
  source = 0; next = 0; event = 0; lost = 0; estop = 0; fault = 0; astray = 0; broken = 0;
  valid = 0; planned = 0; gap = 0; park_wish = 0; engage_wish = 0; late = 0
}

init {
  do
  :: atomic {
       if :: !calm && (!cued || phase == UP) -> calm = 1 :: skip fi;
       if :: calm -> peaceful() :: else -> hostile() fi;
       notice(); follow(); account(); forget(); forget_events()
     }
  od
}
"""


def promela(table: Mapping[State, Mapping[Event, State]] = TABLE) -> str:
    """Write the model.

    Args:
        table: Cells that lead somewhere else, worst event first as in `Event`.

    Returns:
        A Promela model with asserts and the claims of `CLAIMS`.
    """
    parts = [
        "/* written by motionserver.evaluate.proof from the guard's own table */",
        *(f"#define {state.name} {number}" for number, state in enumerate(State)),
        *(f"#define E_{event.name} {number}" for number, event in enumerate(Event)),
        f"#define NONE {len(Event)}",
        f"#define raised {_one_of(RAISED)}",
        f"#define cued {_one_of(CUED)}",
        f"bit {', '.join(f'h_{event.name}' for event in Event)};",
        _WORLD.replace("init {", f"{_follow(table)}\n{_forget()}\ninit {{"),
        *(f"ltl {name} {{ {claim} }}" for name, claim in CLAIMS.items()),
    ]
    return "\n".join(parts) + "\n"


def _one_of(states: frozenset[State]) -> str:
    return f"({' || '.join(f'state == {state.name}' for state in State if state in states)})"


def _follow(table: Mapping[State, Mapping[Event, State]]) -> str:
    """The look-up: of several events the first in the order of `Event` that leads away."""
    lines = ["inline follow() {", "  next = state; event = NONE;"]
    for state in State:
        for event in Event:
            target = table[state].get(event, state)
            if target is not state:
                lines += [
                    f"  if :: state == {state.name} && event == NONE && h_{event.name} ->",
                    f"       event = E_{event.name}; next = {target.name}",
                    "  :: else fi;",
                ]
    return "\n".join([*lines, "  skip", "}"])


def _forget() -> str:
    """Flags of one tick are no part of the state."""
    cleared = "; ".join(f"h_{event.name} = 0" for event in Event)
    return f"inline forget_events() {{ {cleared} }}"
