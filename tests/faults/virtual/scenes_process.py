"""Faults of the guard's own process and of its time: F17, F19, F20, F22 to F24."""

import stated
from fittings import Slot
from scenario import SEND, TICK, Fault

from motionserver.core.device import Order
from motionserver.core.safety.own_moves import REACH
from motionserver.core.safety.states import RAISED, State


class F17(Fault):
    number = 17
    title = "a tick comes too late"
    detection = "gap of the guard's own loop"
    reaction = stated.GAP
    recovery = "automatic"

    def __init__(self, world, rng):
        super().__init__(world, rng)
        self.gap = rng.choice((rng.uniform(0.01, 0.28), rng.uniform(0.32, 0.42)))
        self.stays = self.gap < 0.3
        self.returns = True
        self.seconds = 1.0

    def strike(self):
        self._missed = self.world.counters["missed_slots"] + self.world.counters["late_ticks"]
        self.world.sleep(self.gap, planner=False)

    def onset_ns(self):
        return max(self.struck_ns, self.world.guard_sleeps_until)

    def reacted(self):
        counters = self.world.counters
        seen = counters["missed_slots"] + counters["late_ticks"] > self._missed
        return seen and (self.stays or self.has_left_run)

    def bound(self):
        return 2 * TICK


class F19(Fault):
    number = 19
    title = "suspend, SIGSTOP, pause of the virtual machine"
    detection = "gap of the guard's own loop; the base's own word"
    reaction = stated.SUSPENDED
    recovery = "automatic, or an operator's reset"

    def __init__(self, world, rng):
        super().__init__(world, rng)
        self.seconds = rng.choice((0.1, 0.35, 0.7, 2.0, 3.0))
        self.stays = self.seconds < 0.3

    def strike(self):
        self._late = self.world.counters["late_ticks"]
        self.world.sleep(self.seconds)

    def onset_ns(self):
        return max(self.struck_ns, self.world.guard_sleeps_until)

    def reacted(self):
        return self.world.counters["late_ticks"] > self._late and (self.stays or self.has_left_run)

    def bound(self):
        return 2 * TICK


class F20(F17):
    number = 20
    title = "a garbage collection of 40 to 150 ms"
    detection = "the collector is frozen and off; as F17"
    reaction = "no full collection while raised; as F17"

    def __init__(self, world, rng):
        super().__init__(world, rng)
        self.gap, self.stays = rng.uniform(0.04, 0.15), True

    def check(self):
        raised = {state.value for state in RAISED} & set(self.world.collector.collected)
        return [f"F20: collected in {raised}"] if raised else []


class F22(Fault):
    number = 22
    title = "SIGTERM, service manager stops it"
    detection = "signal"
    reaction = "PARKING, exit status 0 when parked; a second signal hurries nothing"
    recovery = "none needed"

    def strike(self):
        self.world.guard.ask_to_leave("terminated")
        self.world.after(0.5, lambda: self.world.guard.ask_to_leave("terminated again"))

    def reacted(self):
        return self.world.state is State.PARKING

    def bound(self):
        return 2 * TICK

    def check(self):
        status = self.world.guard._done.status
        return [] if status == 0 else [f"F22: exit status {status}"]


class F23(Fault):
    number = 23
    title = "guard crashes or is killed"
    detection = "the spare gets the file lock"
    reaction = "the next sample of the same plan; a late spare begins from measured: PARKING"
    recovery = "none needed; an operator's reset where the base has faulted"

    def __init__(self, world, rng):
        super().__init__(world, rng)
        self.seconds = rng.choice((0.004, 0.02, 0.05, 0.25, 1.0, 2.0))
        self.stays = self.seconds < 0.07

    def strike(self):
        self.world.kill_guard()

    def relent(self):
        self._back_ns = self.world.now
        self.world.start_guard()

    def onset_ns(self):
        return getattr(self, "_back_ns", self.struck_ns)

    def reacted(self):
        if not self.is_over:
            return False
        return self.world.counters["packets_sent"] > 0 and (self.stays or self.has_left_run)

    def bound(self):
        return SEND + 2 * TICK

    def check(self):
        took = self.world.counters["takeovers"]
        return [] if took == 1 else [f"F23: {took} take-overs"]


class F24(Fault):
    number = 24
    title = "restart while the platform is up, nothing left behind"
    detection = "the base's first answers"
    reaction = "OFFLINE, then from where it is measured: PARKING; nothing jumps"
    recovery = "none needed"

    def __init__(self, world, rng):
        super().__init__(world, rng)
        self.seconds = rng.uniform(0.05, 0.4)

    def strike(self):
        self.world.kill_guard()

    def relent(self):
        self.world.files.will = Slot()
        self._back_ns = self.world.now
        self.world.start_guard()
        self._order = 0
        self._off = None

    def look(self):
        world = self.world
        follows = world.encoded.order is Order.FOLLOW
        if self.is_over and self._off is None and follows and world.state is State.PARKING:
            measured = world.base.legs.extensions
            legs = world.encoded.legs - 0.9022
            self._off = max(abs(a - b) for a, b in zip(legs, measured, strict=True))
        super().look()

    def onset_ns(self):
        return getattr(self, "_back_ns", self.struck_ns)

    def reacted(self):
        return self.is_over and self.world.state is State.PARKING

    def bound(self):
        # answers are believed after 0.3 s
        return 0.3 + 2 * SEND + 2 * TICK

    def check(self):
        fine = self._off is not None and self._off < REACH
        return [] if fine else [f"F24: the first setpoint is {self._off} m from the legs"]


SCENES = (F17, F19, F20, F22, F23, F24)
