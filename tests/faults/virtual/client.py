"""A simulator that sends native cues of a lively drive, on the world's clock."""

from dataclasses import replace
from math import cos, pi, sin
from random import Random

from motion_clients.flawed_link import FlawedLink
from motion_protocol import Cue, Mode, Motion, encode_cue

PERIOD = 0.01
SPEED = 20.0


class Drive:
    """A few sines of every axis, by seed: the platform is always on its way somewhere."""

    def __init__(self, seed):
        rng = Random(seed)
        self._tones = [
            [
                (rng.uniform(0.3, 1.0) * size, rng.uniform(low, high), rng.uniform(0, 2 * pi))
                for low, high in ((0.1, 0.3), (0.3, 0.9), (1.0, 2.5))
            ]
            for size in (1.5, 1.5, 0.8, 0.05, 0.05, 0.1)
        ]

    def motion(self, time):
        values = [
            sum(size * sin(2 * pi * hz * time + phase) for size, hz, phase in tones)
            for tones in self._tones
        ]
        attitude = (0.02 * sin(0.5 * time), 0.02 * cos(0.4 * time))
        return Motion(tuple(values[:3]), tuple(values[3:]), attitude, speed=SPEED)


class Client:
    """Sends 100 times a second; `alter` changes cues, `spoil` what becomes of their bytes."""

    def __init__(self, world, session, address, key=None):
        self.world, self.session, self.address, self.key = world, session, address, key
        self.drive = Drive(world.rng.getrandbits(32))
        self.is_sending = True
        self.mode = Mode.DRIVE
        self.alter = []
        self.spoil = []
        self.link = FlawedLink(seed=world.rng.getrandbits(32))
        self.held = None
        self.sequence = 0
        self.sent_ns = 0
        self.sent = []
        self._lives = True

    def start(self):
        self._tick()

    def _tick(self):
        if self.is_sending:
            self.send()
        self.world.after(PERIOD, self._tick)

    def cue(self):
        """The next cue, unaltered."""
        now = self.world.now
        self.sequence += 1
        motion = self.drive.motion(self.world.elapsed)
        return Cue(self.session, self.sequence, now, now, motion, self.mode)

    def send(self):
        cue = self.cue()
        for alter in self.alter:
            cue = alter(cue)
        packets = [encode_cue(cue, self.key)]
        for spoil in self.spoil:
            packets = [out for data in packets for out in spoil(data)]
        for data in packets:
            self.put(data)

    def put(self, data):
        """Onto the wire, through its flaws; while it is held it comes later, all at once."""
        self.sent_ns = self.world.now
        self.sent = [*self.sent[-49:], data]
        if self.held is not None:
            self.held.append(data)
            return
        for arrival in self.link.carry(self.world.seconds, data):
            deliver = lambda data=arrival.datagram: self.world.way.put(data, self.address)  # noqa: E731
            if arrival.delay > 0.0:
                self.world.after(arrival.delay, deliver)
            else:
                deliver()

    def let_go(self):
        """What was held arrives at once."""
        held, self.held = self.held or [], None
        for data in held:
            self.world.way.put(data, self.address)

    def moving(self, **changed):
        """An alteration: these values of the motion become others."""

        def alter(cue):
            values = {name: change(getattr(cue.motion, name)) for name, change in changed.items()}
            return replace(cue, motion=replace(cue.motion, **values))

        return alter
