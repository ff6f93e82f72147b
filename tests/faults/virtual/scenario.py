"""A fault as a scenario, and how one or two of them are played and judged."""

import statistics
from dataclasses import dataclass
from random import Random
from typing import ClassVar

from fittings import SECOND, fitted
from world import SEND_HZ, World

from motionserver.core.safety.states import RAISED, State
from motionserver.core.safety.supervisor import is_standing

TICK = 1 / 240
SEND = 1 / SEND_HZ
CLOSING = 8.5
"""Long enough to come to rest, go home and settle [s]."""
EXTRA = 15.0
"""How long after its time a scene is waited for, before it counts as never ended [s]."""
LEAST = 2.0
"""A brief scene runs at least so long [s]."""
STEP = 0.1
ASK_AGAIN = 2.5
LATCHED = (State.FAULT, State.SAFE)


def stale(world):
    """The client sends 100 times a second: stale after max(50 ms, 3 T) [s]."""
    return max(0.05, 3.0 * world.period)


class Fault:
    """One fault of the list; subclasses say what happens and what must follow.

    Attributes:
        number, title, detection, reaction, recovery: As in the table of `deploy/faults.md`.
        setup: What the world needs besides, e.g. a key.
        stays: The platform must go on running throughout.
        returns: It must run again by itself when the fault has gone.
        from_start: It is there before the server starts.
    """

    number = 0
    title = detection = reaction = recovery = ""
    setup: ClassVar[dict] = {}
    stays = returns = from_start = False

    def __init__(self, world, rng):
        self.world, self.rng = world, rng
        self.seconds = rng.uniform(0.5, 3.0)
        self.struck_ns = self.reacted_ns = None
        self.is_over = False

    @property
    def name(self):
        return f"F{self.number}"

    def strike(self):
        raise NotImplementedError

    def relent(self):
        pass

    def reacted(self):
        raise NotImplementedError

    def bound(self):
        """Longest time from `onset_ns` to the reaction [s]."""
        raise NotImplementedError

    def onset_ns(self):
        return self.struck_ns

    def check(self):
        """What else must hold at the end: sentences of what does not."""
        return []

    def look(self):
        """After every tick of the guard."""
        if self.struck_ns is not None and self.reacted_ns is None and self.reacted():
            self.reacted_ns = self.world.now

    @property
    def took(self):
        """Measured reaction [s]; None if there was none."""
        if self.reacted_ns is None:
            return None
        return max(0.0, (self.reacted_ns - self.onset_ns()) / SECOND)

    @property
    def has_left_run(self):
        return self.world.state is not State.RUN


@dataclass
class Outcome:
    """What came of one scene."""

    names: tuple
    seed: int
    problems: list
    late: list
    took: dict
    bounds: dict
    violations: int
    states: list
    digest: str
    seconds: float


class Scene:
    """One world in which some faults happen."""

    def __init__(
        self,
        faults,
        seed,
        seconds,
        planner_hz=60.0,
        algorithm="classical",
        calm=False,
        is_brief=False,
    ):
        setup: ClassVar[dict] = {}
        for cls in faults:
            setup |= cls.setup
        self.world = World(seed, planner_hz, algorithm, **setup)
        self.classes, self.seed, self.seconds, self.calm = faults, seed, seconds, calm
        self.problems, self._asked, self._ran_ns = [], -1e9, 0
        self.is_hasty, self.is_brief = False, is_brief

    def play(self):
        world = self.world
        with fitted(world) as patch:
            world.patch = patch
            self.faults = [cls(world, Random(f"{self.seed} {cls.number}")) for cls in self.classes]
            if not self.calm:
                world.watchers += [fault.look for fault in self.faults]
            self._begin()
            self._live()
            self._end()
        return self.outcome()

    def _begin(self):
        world = self.world
        early = [fault for fault in self.faults if fault.from_start and not self.calm]
        for fault in early:
            self._strike(fault)
        world.start()
        while not all(fault.is_over for fault in early):
            world.run(STEP)
        world.engage()
        self._ran_ns = world.now
        latest = max(0.5, (self.seconds - CLOSING - world.elapsed - 4.0) * 0.7)
        for fault in self.faults:
            at = world.rng.uniform(0.5, latest)
            if not self.calm and not fault.from_start:
                world.after(at, lambda fault=fault: self._strike(fault))

    def _strike(self, fault):
        fault.struck_ns = self.world.now
        fault.strike()
        self.world.after(fault.seconds, lambda: self._relent(fault))

    def _relent(self, fault):
        fault.relent()
        fault.is_over = True

    def _live(self):
        """Until the operator parks; resets when everything stands and the cause has gone."""
        world = self.world
        while world.elapsed < self.seconds - CLOSING:
            self._operate()
            if world.guard._done.done():
                return
            if self.is_brief and self._goes_on():
                break
        for fault in self.faults:
            if self.calm:
                continue
            if fault.stays and len(self.faults) == 1 and self._left_run():
                self.problems.append(f"{fault.name} disturbed the drive: {world.record.events}")
            if fault.returns and len(self.faults) == 1 and world.state is not State.RUN:
                self.problems.append(f"{fault.name}: {world.state} instead of RUN again")

    def _goes_on(self):
        """Everything is over, and it has run again for a while: nothing more will come."""
        world = self.world
        begun = self._ran_ns + int(LEAST * SECOND)
        over = all(fault.is_over for fault in self.faults) and not self.calm
        at, state = world.account.states[-1]
        return over and state is State.RUN and world.now - max(at, begun) > SECOND

    def _left_run(self):
        return [
            s for at, s in self.world.account.states if at > self._ran_ns and s is not State.RUN
        ]

    def _operate(self):
        world = self.world
        over = all(fault.is_over for fault in self.faults) or self.calm
        if (
            over
            and world.state in LATCHED
            and is_standing(world.record.playback)
            and (self.is_hasty or world.base.is_at_rest)
            and world.elapsed - self._asked > ASK_AGAIN
        ):
            self._asked = world.elapsed
            world.ask("reset")
        world.run(STEP)

    def _end(self):
        """Park and come to an end; a scene that ended sooner is not waited out."""
        world = self.world
        end = max(self.seconds, world.elapsed + CLOSING) + EXTRA
        parked = 0
        while world.elapsed < end and parked < 3:
            if world.state in RAISED - {State.PARKING} and not world.guard._done.done():
                world.ask("park")
            self._operate()
            parked = parked + 1 if self._is_parked() else 0
        if parked < 3:
            self.problems.append(f"never parked: {world.state}, base {world.base.state.name}")
        if not world.account.ended_safe:
            self.problems.append("the base did not end safe")

    def _is_parked(self):
        world = self.world
        return world.base.is_parked and (world.state is State.PARKED or world.guard._done.done())

    def outcome(self):
        world, faults = self.world, [] if self.calm else self.faults
        late = []
        for fault in faults:
            took = fault.took
            if took is None:
                late.append(f"{fault.name}: no reaction ({world.state}: {world.record.reason})")
            elif took > fault.bound() + 1e-6:
                late.append(f"{fault.name}: {took:.4f} s, bound {fault.bound():.4f} s")
            if len(faults) == 1:
                self.problems += fault.check()
        errors = world.counters["tick_errors"]
        if errors and not any(getattr(fault, "may_fail_ticks", False) for fault in faults):
            self.problems.append(f"{errors} ticks of the guard failed")
        return Outcome(
            tuple(fault.name for fault in self.faults),
            self.seed,
            self.problems + world.account.problems(),
            late,
            {fault.name: fault.took for fault in faults},
            {fault.name: fault.bound() for fault in faults},
            world.account.violations,
            [(round((at - world.began) * 1e-9, 3), s.value) for at, s in world.account.states],
            world.digest(),
            world.elapsed,
        )


def median(values):
    return statistics.median(values) if values else None
