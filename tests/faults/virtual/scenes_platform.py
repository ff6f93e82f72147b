"""Faults of the base and of the way to it: F10 to F13, F25, F31, F36."""

import struct

import numpy as np
import stated
from fittings import BASE
from motion_clients.flawed_link import LinkFlaws
from motion_clients.moog_wire import Fault as Bit
from motion_clients.moog_wire import MachineState, Mcw, decode_command
from scenario import SEND, TICK, Fault, stale

from motionserver.core.device import Order
from motionserver.core.safety.states import State
from motionserver.core.safety.watchdog import Patience

PATIENCE = Patience()
LOST = max(PATIENCE.feedback, 6 * SEND)
FAULTED = (State.FAULT, State.SAFE)


class PlatformFault(Fault):
    """The base is judged by what it says and does; an operator's edge ends it."""

    def reacted(self):
        return self.world.state in FAULTED

    def bound(self):
        # an answer is read a tick after it came; it is missed when the next one is due
        return LOST + SEND + 2 * TICK


class Astray(PlatformFault):
    """Counted from when the base is further from its command than allowed, or has faulted."""

    _beyond_ns = None

    def look(self):
        world = self.world
        if self.struck_ns is not None and world.encoded.order is Order.FOLLOW:
            legs = world.encoded.legs - 0.9022
            off = np.abs(legs - np.array(world.base.legs.extensions))
            speeds = self._speeds(world.encoded.legs)
            astray = off > PATIENCE.track + PATIENCE.track_lag * speeds
            if astray.any() or MachineState.FAULT1 <= world.base.state <= MachineState.FAULT3:
                self._beyond_ns = self._beyond_ns or world.now
            elif self.reacted_ns is None:
                self._beyond_ns = None
        super().look()

    def _speeds(self, legs):
        last, self._last = getattr(self, "_last", (0, legs)), (self.world.now, legs)
        elapsed = max(SEND, (self.world.now - last[0]) * 1e-9)
        return np.abs(legs - last[1]) / elapsed

    def onset_ns(self):
        return self._beyond_ns or self.struck_ns


class F10(PlatformFault):
    number = 10
    title = "platform silent"
    detection = stated.SILENT_BASE
    reaction = "FAULT: the accepted plan plays to rest, packets go on"
    recovery = "an operator's reset"

    def strike(self):
        self._sent = len(self.world.account.log.records)
        self.world.to_host.flaws = LinkFlaws(loss=1.0)

    def relent(self):
        self._sent = len(self.world.account.log.records) - self._sent
        self.world.to_host.flaws = LinkFlaws()

    def check(self):
        least = int(self.seconds / SEND) - 2
        return [] if self._sent >= least else [f"F10: {self._sent} packets in {self.seconds} s"]


class F11(PlatformFault):
    number = 11
    title = "platform reports a fault or an emergency stop"
    detection = "its fault bits, its state"
    reaction = "FAULT or SAFE: follow, never fight"
    recovery = "an operator's reset"

    def __init__(self, world, rng):
        super().__init__(world, rng)
        self.kind = rng.choice(("estop", "fault", "fault", "stands"))
        self.bit = rng.choice((Bit.TORQUE_MONITOR, Bit.AMPLIFIER, Bit.LIMIT_SWITCH, Bit.SNUBBER))

    def strike(self):
        base = self.world.base
        if self.kind == "estop":
            base.press_estop()
        else:
            base.latch_fault(self.bit, 1 if self.kind == "stands" else 2)

    def relent(self):
        if self.kind == "estop":
            self.world.base.release_estop()

    def bound(self):
        return SEND + 2 * TICK

    def reacted(self):
        return self.world.state is (State.SAFE if self.kind == "estop" else State.FAULT)


class F12(Fault):
    number = 12
    title = "platform late, jittery; its wire loses, doubles, reorders"
    detection = "age of the newest answer"
    reaction = "none below the limit; as F10 at the limit"
    recovery = "automatic; as F10 beyond the limit"

    def __init__(self, world, rng):
        super().__init__(world, rng)
        self.kind = rng.choice(("late", "lossy", "mixed", "limit"))
        self.stays = self.kind == "late"

    def strike(self):
        world, rng = self.world, self.rng
        if self.kind == "late":
            world.to_host.flaws = LinkFlaws(delay=rng.uniform(0, 0.03), jitter=0.06)
        elif self.kind == "lossy":
            world.to_base.flaws = LinkFlaws(loss=0.1)
            world.to_host.flaws = LinkFlaws(loss=0.2, jitter=0.02)
        elif self.kind == "mixed":
            world.account.wire_may_reorder = True
            world.to_base.flaws = LinkFlaws(
                loss=0.03, duplicate=0.1, reorder=0.1, jitter=0.01, delay=rng.uniform(0, 0.02)
            )
        else:
            world.to_host.flaws = LinkFlaws(loss=0.9, jitter=0.1)

    def relent(self):
        self.world.to_host.flaws = self.world.to_base.flaws = LinkFlaws()

    def look(self):
        # the age grows by a tick each tick: what is asked is that it is judged right
        device = self.world.guard.guard.supervisor.device
        lost = device.is_lost(self.world.now)
        if self.struck_ns is not None and lost and not hasattr(self, "_lost_ns"):
            self._lost_ns = self.world.now
        super().look()

    def reacted(self):
        if self.kind == "limit":
            return self.world.state in FAULTED
        return True

    def onset_ns(self):
        return getattr(self, "_lost_ns", self.struck_ns)

    def bound(self):
        return 2 * TICK


class F13(Astray):
    number = 13
    title = "platform does not follow"
    detection = stated.ASTRAY
    reaction = "FAULT: the accepted plan plays to rest"
    recovery = "an operator's reset"

    def __init__(self, world, rng):
        super().__init__(world, rng)
        self.seconds = 4.0
        self.leg = rng.randrange(6)

    def strike(self):
        # freed, it hurries to where it should have been
        self.world.account.base_moves_itself = True
        self.world.base.stick_leg(self.leg)
        self.world.client.alter.append(
            self.world.client.moving(acceleration=lambda a: (a[0] + 4.0, a[1] + 2.0, a[2]))
        )

    def relent(self):
        self.world.base.free_leg(self.leg)
        self.world.client.alter.pop()

    def bound(self):
        # what it says of itself is late by its lag and one and a half frames
        return PATIENCE.track_time + 0.035 + 3 * SEND + 2 * TICK


class F25(Fault):
    number = 25
    title = "no answer at the start"
    detection = stated.NO_ANSWER
    reaction = "OFFLINE; only the mode word is sent, which moves nothing; no engaging"
    recovery = "it answers: PARKED"
    from_start = True

    def __init__(self, world, rng):
        super().__init__(world, rng)
        self.seconds = rng.uniform(1.0, 3.0)

    def strike(self):
        self.world.to_host.flaws = LinkFlaws(loss=1.0)
        self.world.after(0.5, lambda: self.world.ask("engage"))

    def relent(self):
        told = {decode_command(data).mcw for _, data in self.world.account.log.records}
        self._told = told
        self._state = self.world.state
        self.world.to_host.flaws = LinkFlaws()

    def reacted(self):
        return self.world.state is State.OFFLINE and self.world.counters["setpoints"] > 0

    def bound(self):
        return SEND + 2 * TICK

    def check(self):
        fine = self._told == {Mcw.LENGTH_MODE} and self._state is State.OFFLINE
        return [] if fine else [f"F25: {self._state}, sent {self._told}"]


class F31(PlatformFault):
    number = 31
    title = "cable pulled, base's side or client's side"
    detection = "as F10 and F1; what the network refuses to send is caught"
    reaction = "base's side FAULT, client's side HOLD; the plan's clock pauses while not sent"
    recovery = "as F10 and F1"

    def __init__(self, world, rng):
        super().__init__(world, rng)
        self.at_base = rng.random() < 0.7
        self.seconds = rng.choice((rng.uniform(0.05, 0.09), rng.uniform(0.15, 0.45), 1.5, 3.0))
        if not self.at_base:
            self.seconds = max(self.seconds, 0.3)

    def strike(self):
        if self.at_base:
            self.world.unplug_base()
            self.world.to_host.flaws = LinkFlaws(loss=1.0)
        else:
            self._sent_ns = self.world.client.sent_ns
            self.world.client.is_sending = False

    def relent(self):
        self.world.plug_base()
        self.world.to_host.flaws = LinkFlaws()
        self.world.client.is_sending = True

    @property
    def is_short(self):
        return self.at_base and self.seconds < 0.1

    def onset_ns(self):
        return self.struck_ns if self.at_base else self._sent_ns

    def reacted(self):
        if self.is_short:
            return self.world.counters["send_errors"] > 0
        return super().reacted() if self.at_base else self.has_left_run

    def bound(self):
        if not self.at_base:
            return stale(self.world) + self.world.period + self.world.thinking + 2 * TICK
        return LOST + SEND + 2 * TICK


class F36(Astray):
    number = 36
    title = "a second server on the same base"
    detection = "exclusive port and lock; by its effect on the base: fault, state, tracking error"
    reaction = "a second refuses to start; a foreign one's effects are FAULT"
    recovery = "an operator's reset"

    def __init__(self, world, rng):
        super().__init__(world, rng)
        self.kind = rng.choice(("neutral", "park", "answers"))
        self.stays = self.kind == "answers"

    def strike(self):
        self._count = self.world.counters["feedback_foreign"]
        self.world.account.wire_may_reorder = True
        self._goes_on = True
        self._other()

    def _other(self):
        world = self.world
        if not self._goes_on:
            return
        config = world.account.config
        words = config.neutral
        word = Mcw.PARK if self.kind == "park" else Mcw.NEW_POSITION
        if self.kind == "answers":
            world.hear(bytes(40), ("192.0.2.66", 991))
            world.hear(bytes(39), BASE)
        else:
            world.base.advance(world.seconds)
            world.base.receive(struct.pack(">I6fI", word, *words, 0), world.seconds)
        world.after(SEND, self._other)

    def relent(self):
        self._goes_on = False

    def reacted(self):
        if self.kind == "answers":
            return self.world.counters["feedback_foreign"] > self._count
        return super().reacted()

    def bound(self):
        # a foreign setpoint shows as an error of tracking, or as a fault of the base by its jump
        return PATIENCE.track_time + 0.035 + 6 * SEND


SCENES = (F10, F11, F12, F13, F25, F31, F36)
