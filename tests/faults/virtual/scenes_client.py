"""Faults of the simulator that is silent, late, or not alone: F1, F6, F7, F32, F34."""

from typing import ClassVar

import stated
from client import Client
from scenario import TICK, Fault, stale

INTERVAL = 0.01


class ClientFault(Fault):
    """Something is wrong with what the client sends."""

    counter = ""

    def __init__(self, world, rng):
        super().__init__(world, rng)
        self.client = world.client
        self._before = 0
        self._is_first = True

    def is_wrong(self, share):
        """Whether this packet is one of the wrong ones; the first always is."""
        is_first, self._is_first = self._is_first, False
        return self.rng.random() < share or is_first

    def counted(self):
        return sum(n for name, n in self.world.heard.items() if name.startswith(self.counter))

    def look(self):
        if self.struck_ns is None:
            self._before = self.counted()
        super().look()

    def reacted(self):
        return self.counted() > self._before

    def bound(self):
        """A wrong packet comes an interval later, and waits one planner period at most."""
        return INTERVAL + self.world.period + self.world.thinking + 2 * TICK


class Silence(ClientFault):
    """What follows is judged from the last packet that was sent."""

    def onset_ns(self):
        return self.client.sent_ns if self._last is None else self._last

    _last = None

    def strike(self):
        self._last = self.client.sent_ns

    def reacted(self):
        return self.has_left_run

    def bound(self):
        # a packet is stamped when it is read, at most a period after it came
        return stale(self.world) + self.world.period + self.world.thinking + 2 * TICK


class F1(Silence):
    number = 1
    title = "client silent"
    detection = "age of the newest packet > max(50 ms, 3 T)"
    reaction = (
        f"{stated.FADE_AND_PARK}, of a format that pauses by silence (BeamNG) after {stated.PAUSED}"
    )
    recovery = stated.FRESH

    def __init__(self, world, rng):
        super().__init__(world, rng)
        self.seconds = rng.choice((rng.uniform(0.1, 1.3), rng.uniform(2.2, 3.0)))
        self.returns = self.seconds < 1.5

    def strike(self):
        super().strike()
        self.client.is_sending = False

    def relent(self):
        self.client.is_sending = True

    def check(self):
        if self.seconds > 2.2 and "PARKING" not in [s.value for _, s in self.world.account.states]:
            return ["F1: held for more than 2 s and did not park"]
        return []


class F6(ClientFault):
    number = 6
    title = "a burst of old packets after a stall"
    detection = (
        "spacing of arrivals against that of the sender's times; its clock may drift or be set"
    )
    reaction = "HOLD in the stall; the old ones are dropped and counted"
    recovery = "automatic"
    counter = "refused_old"
    returns = True

    def __init__(self, world, rng):
        super().__init__(world, rng)
        self.seconds = rng.uniform(0.3, 1.2)

    def strike(self):
        self.client.held = []

    def relent(self):
        self._released = self.world.now
        self.client.let_go()

    def onset_ns(self):
        return self._released

    def bound(self):
        return self.world.period + self.world.thinking + 2 * TICK


class F7(ClientFault):
    number = 7
    title = "two clients"
    detection = "owner: input, address, session"
    reaction = "the first keeps the platform, the other is refused and shown"
    recovery = "owner silent for 2 s and not in RUN"
    counter = "refused_second_client"
    stays = True

    def strike(self):
        self.other = Client(self.world, 8, self.rng.choice(("192.0.2.8:5000", self.client.address)))
        self.other.key = self.client.key
        self.other.start()

    def relent(self):
        self.other.is_sending = False

    def check(self):
        owner = self.world.inputs.vehicle.owner
        return [] if owner.session == self.client.session else ["F7: the owner changed in RUN"]


class F32(F1):
    number = 32
    title = "Zenoh router restarts, network is parted"
    detection = "age of the newest packet, never Zenoh's liveliness"
    reaction = stated.FADE_AND_PARK
    setup: ClassVar[dict] = {"kind": "zenoh"}

    def strike(self):
        Silence.strike(self)
        self.keeps = self.rng.random() < 0.5
        if self.keeps:
            self.client.held = []
        else:
            self.client.is_sending = False

    def relent(self):
        self.client.is_sending = True
        self.client.let_go()


class F34(Silence):
    number = 34
    title = "client of another version"
    detection = "major version of every packet"
    reaction = "refused with the reason; nothing believed: as F1"
    recovery = "a client of this version: as F1"
    counter = "refused_version"

    def strike(self):
        super().strike()
        self.client.spoil.append(self._newer)

    def _newer(self, data):
        return [data[:4] + bytes([data[4] + 1]) + data[5:]]

    def relent(self):
        self.client.spoil.remove(self._newer)

    def check(self):
        return [] if self.counted() else ["F34: no packet was refused for its version"]


SCENES = (F1, F6, F7, F32, F34)
