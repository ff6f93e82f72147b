"""What joins the product's pieces in one process: files, sockets and clocks that are none."""

from collections import Counter, deque
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest

from motionserver.planner.sessions import Sessions
from motionserver.platforms.moog import Moog6Dof2000E
from motionserver.sources.udp import BUFFER, DRAIN
from motionserver.sources.zenoh_input import DEPTH
from motionserver.telemetry.link import PLAN_BYTES
from motionserver.telemetry.requests import DRAIN as REQUESTS_DRAIN

NOWHERE = Path("/nonexistent/motionserver")
BASE = ("192.0.2.1", 991)
QUEUED_REQUESTS = 10
"""Datagrams that a unix socket holds by default."""
OVERHEAD = 768
"""What the kernel charges for a small datagram [bytes]."""
SECOND = 1_000_000_000


class Slot:
    """A mapped file without a file: the newest message, with its sequence."""

    def __init__(self, capacity=None, later=None):
        self.capacity, self._later = capacity, later
        self._message, self._sequence = None, 0

    def write(self, data):
        if self.capacity is not None and len(data) > self.capacity:
            raise ValueError(f"{len(data)} bytes, a slot holds {self.capacity}")
        if self._later is None:
            self._put(bytes(data))
        else:
            self._later(lambda: self._put(bytes(data)))

    def _put(self, data):
        self._sequence += 1
        self._message = (self._sequence, data)

    def newest_sequence(self):
        return self._sequence

    def read(self):
        return self._message


class Files:
    """What planner, guard and page share; a proposal appears when its thinking has ended."""

    def __init__(self, when_thought):
        self.proposal = Slot(PLAN_BYTES, when_thought)
        self.accepted, self.clock, self.cue, self.will = Slot(PLAN_BYTES), Slot(), Slot(), Slot()
        self.sent = Slot()
        self.guard, self.planner, self.service = Slot(32768), Slot(32768), Slot(8192)
        self.trace = Slot()


class Requests:
    """A request socket: bounded as the kernel's, a few served per tick, answers kept."""

    def __init__(self):
        self.malformed, self.refusal = 0, ""
        self.dropped = 0
        self.answers = deque(maxlen=1000)
        self._waiting = deque()

    def put(self, message, address="console"):
        if len(self._waiting) >= QUEUED_REQUESTS:
            self.dropped += 1
        else:
            self._waiting.append((message, address))

    def poll(self):
        out = []
        while self._waiting and len(out) < REQUESTS_DRAIN:
            message, address = self._waiting.popleft()
            if isinstance(message, dict) and isinstance(message.get("op"), str):
                out.append((message, address))
            else:
                self.malformed += 1
        return out

    def answer(self, address, message):
        self.answers.append((address, message))

    def close(self):
        pass


class UdpWay:
    """A receive buffer of the kernel's size: full, it drops the newest; stamped when drained."""

    def __init__(self, clock):
        self._clock = clock
        self._room = BUFFER // OVERHEAD
        self._held = deque()
        self.flood_hz = 0.0
        self.flood = b"x"
        self._flooded_ns = 0
        self.dropped = 0
        self.broken = None

    def put(self, data, address):
        self._fill()
        if len(self._held) < self._room:
            self._held.append((data, address))
        else:
            self.dropped += 1

    def _fill(self):
        """What a flood has brought since: only as much as there is room for matters."""
        now = self._clock()
        if self.flood_hz:
            came = int((now - self._flooded_ns) * self.flood_hz / SECOND)
            for _ in range(min(came, self._room - len(self._held))):
                self._held.append((self.flood, "203.0.113.9:9"))
        self._flooded_ns = now

    def drain(self):
        if self.broken is not None:
            raise self.broken
        self._fill()
        now = self._clock()
        count = min(DRAIN, len(self._held))
        return [(*self._held.popleft(), now) for _ in range(count)]

    def reply(self, name, data):
        pass

    def close(self):
        pass


class ZenohWay(UdpWay):
    """The newest samples, stamped as they come."""

    def __init__(self, clock):
        super().__init__(clock)
        self._samples = deque(maxlen=DEPTH)

    def put(self, data, address):
        self._samples.append((data, "zenoh:motion/0/in/cue", self._clock()))

    def drain(self):
        return [self._samples.popleft() for _ in range(len(self._samples))]


class Box:
    """No black box: its room is mapped files, and tests of its own."""

    def __init__(self, *_):
        pass

    def __getattr__(self, name):
        return lambda *_: None


class Remembered:
    """Signed sessions, kept over the death of a planner as the run directory keeps them."""

    def __init__(self):
        self.counters = Counter()
        self.hear = Sessions().hear

    def keep(self):
        pass

    def close(self):
        pass


class Done:
    """The guard's future: its exit status once it has ended."""

    status = None

    def done(self):
        return self.status is not None

    def set_result(self, status):
        self.status = status


class Alarm:
    """The guard's timer."""

    def __init__(self, arm):
        self.arm = arm

    def close(self):
        pass


class Collector:
    """The garbage collector as the guard uses it: counts, by motion state."""

    def __init__(self, state):
        self._state = state
        self.collected = Counter()

    def collect(self, *_):
        self.collected[self._state()] += 1

    def freeze(self):
        pass

    def disable(self):
        pass


@contextmanager
def fitted(world):
    """While it lasts, the product's loops use the world's files, sockets and clock."""

    class Noting(Moog6Dof2000E):
        def encode(self, setpoint):
            world.encoded = setpoint
            return super().encode(setpoint)

    def opened(options):
        from motionserver.planner.inputs import Input

        return Input(options, world.ways[options.port])

    def requests(path):
        return world.requests[path.stem]

    quiet = SimpleNamespace(collect=lambda *_: 0, freeze=lambda: None, disable=lambda: None)
    with pytest.MonkeyPatch.context() as patch:
        for name, value in {
            "guard.ports.Maps": lambda _: world.files,
            "guard.ports.now_ns": world.clock,
            "guard.ports.make_platform": lambda _, options: Noting(options),
            "guard.loop.RequestServer": requests,
            "guard.loop.GuardBox": Box,
            "guard.loop.now_ns": world.clock,
            "guard.loop.gc": world.collector,
            "guard.loop.SNAPSHOT_NS": SECOND,
            "planner.loop.Maps": lambda _: world.files,
            "planner.loop.RequestServer": requests,
            "planner.loop.PlannerBox": Box,
            "planner.loop.open_input": opened,
            "planner.loop.keeper_of": lambda *_: world.sessions,
            "planner.loop.now_ns": world.planner_clock,
            "planner.loop.SNAPSHOT_NS": SECOND,
            "planner.loop.gc": quiet,
            "planner.reply.now_ns": world.planner_clock,
            "planner.tuner.time": SimpleNamespace(monotonic=lambda: world.now * 1e-9),
        }.items():
            patch.setattr(f"motionserver.{name}", value)
        make = __import__("motionserver.cueing.think", fromlist=["think"])
        product = make.make_cueing
        patch.setattr(make, "make_cueing", lambda *a: world.mind(product(*a)))
        yield patch
