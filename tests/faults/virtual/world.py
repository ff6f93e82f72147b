"""Planner, guard, base and client on one clock that nobody winds but us: no sockets, no sleeps.

The planner's and the guard's own loops run, wake by wake; `fittings` stands in for their files,
sockets and clocks. Thinking takes virtual time, so a plan appears when it would have.
"""

import errno
import hashlib
from heapq import heappop, heappush
from itertools import count
from random import Random

import numpy as np
from account import Account
from client import Client
from fittings import (
    BASE,
    NOWHERE,
    SECOND,
    Alarm,
    Collector,
    Done,
    Files,
    Remembered,
    Requests,
    UdpWay,
    ZenohWay,
)
from machines import compact
from motion_clients.flawed_link import FlawedLink
from motion_clients.moog_config import MoogConfig
from motion_clients.moog_device import MoogDevice

from motionserver.core.axes import frozen
from motionserver.core.safety.given import GuardConfig
from motionserver.core.safety.states import State
from motionserver.core.safety.supervisor import is_standing
from motionserver.guard.loop import GuardLoop
from motionserver.guard.options import GuardOptions
from motionserver.planner.loop import PlannerLoop
from motionserver.planner.options import InputOptions, PlannerOptions
from motionserver.platforms.base import PlatformOptions

SEND_HZ = 60.0
RETRACTED = 0.9022
PORT = 4600
THINKING = 0.003
"""How long a plan takes [s]."""
LATE_NS = 50_000
"""No timer fires before its instant, and none exactly then [ns]."""
WATCH = 0.05
"""How often the base is looked at while nothing is sent [s]."""


class Mind:
    """A cueing algorithm whose thinking takes time, and that a fault may spoil."""

    def __init__(self, cueing, world):
        self._cueing, self._world = cueing, world
        self.disturbance = np.zeros(3)

    def propose(self, start, parent, takeover, stimulus):
        self._world.think(self._world.thinking)
        self._cueing.disturbance = self.disturbance
        candidate = self._cueing.propose(start, parent, takeover, stimulus)
        for spoil in self._world.spoilers:
            candidate = spoil(candidate)
        return candidate

    def __getattr__(self, name):
        return getattr(self._cueing, name)


class World:
    """A server, its base, its client and its operator; within `fittings.fitted` only."""

    def __init__(self, seed, planner_hz=60.0, algorithm="classical", kind="native", key=None):
        self.rng = Random(seed)
        self.now = self.began = 1_000_000_000_000
        self._events, self._order = [], count()
        self.machine = compact()
        self.period = 1.0 / planner_hz
        self.files = Files(self._when_thought)
        self.requests = {"guard": Requests(), "planner": Requests()}
        self.way = (ZenohWay if kind == "zenoh" else UdpWay)(self.planner_clock)
        self.ways = {PORT: self.way}
        self.encoded = None
        self.collector = Collector(lambda: self.state.value)
        config = MoogConfig(lift_duration=2.0)
        self.account = Account(self, config)
        self.base = MoogDevice(config, on_step=self.account.stepped)
        self.to_base, self.to_host = FlawedLink(seed=seed + 1), FlawedLink(seed=seed + 2)
        self.refuses_to_send = None
        self.link_trouble = None
        self._answers = []
        self.client = Client(self, 7, "192.0.2.7:5000", key)
        self.thinking, self._ahead, self.spoilers = THINKING, 0, []
        self.watchers = []
        self._guards = self._planners = 0
        self.guard_sleeps_until = self.planner_sleeps_until = 0
        self._guard_options = GuardOptions(
            GuardConfig(self.machine, 1.0 / SEND_HZ, self.period),
            "moog-6dof2000e",
            PlatformOptions(length_offset=RETRACTED),
            BASE,
            SEND_HZ,
            (),
            None,
            False,
        )
        self._planner_options = PlannerOptions(
            self.machine,
            self.period,
            1.0 / SEND_HZ,
            min(0.01, 0.8 * self.period),
            frozen(np.zeros(3)),
            (InputOptions(kind, "192.0.2.1", PORT, key, "motion/0/in/cue", ()),),
            {"algorithm": algorithm, "scale": 0.6},
            NOWHERE / "tuning.json",
            NOWHERE / "sessions.bin",
            False,
        )
        self.sessions = Remembered() if key else None
        self.base.advance(self.seconds)
        self._watch_base()

    # Time.

    @property
    def seconds(self):
        return self.now * 1e-9

    @property
    def elapsed(self):
        """Since the world began [s]."""
        return (self.now - self.began) * 1e-9

    def clock(self):
        return self.now

    def planner_clock(self):
        return self.now + self._ahead

    def at(self, instant_ns, action):
        heappush(self._events, (max(int(instant_ns), self.now), next(self._order), action))

    def after(self, seconds, action):
        self.at(self.now + round(seconds * SECOND), action)

    def run(self, seconds):
        """Let so much time pass."""
        end = self.now + round(seconds * SECOND)
        while self._events and self._events[0][0] <= end:
            self.now, _, action = heappop(self._events)
            action()
        self.now = end
        self.base.advance(self.seconds)

    def until(self, condition, seconds, what):
        for _ in range(round(seconds / 0.01)):
            if condition():
                return
            self.run(0.01)
        raise AssertionError(f"no {what} in {seconds:g} s: {self.state}: {self.record.reason}")

    # The guard.

    @property
    def record(self):
        return self.guard.guard.record

    @property
    def state(self):
        return self.record.state

    @property
    def counters(self):
        return self.record.counters

    def start_guard(self):
        """Another guard on the same files, as the supervisor or the spare would start it."""
        self._guards += 1
        mine = self._guards
        self.guard = loop = GuardLoop(self._guard_options, NOWHERE, self, "virtual")
        loop._done = Done()
        loop._ticker = Alarm(
            lambda instant: self.at(instant + LATE_NS, lambda: self._wake_guard(mine))
        )
        loop._begin(self.now)

    def kill_guard(self):
        self._guards += 1

    def _wake_guard(self, mine):
        if mine != self._guards or self.guard._done.done():
            return
        if self.now < self.guard_sleeps_until:
            self.at(self.guard_sleeps_until, lambda: self._wake_guard(mine))
            return
        before, stood = self.state, is_standing(self.record.playback)
        self.guard._wake()
        self.account.woken(before, stood)
        for watcher in self.watchers:
            watcher()

    # The guard's socket.

    def sendto(self, data, peer):
        assert peer == BASE
        if self.refuses_to_send is not None:
            raise self.refuses_to_send
        self.base.advance(self.seconds)
        self.account.sent(data, self.encoded)
        for arrival in self.to_base.carry(self.seconds, data):
            self._later(arrival.delay, lambda data=arrival.datagram: self._arrive(data))

    def _arrive(self, data):
        self.base.advance(self.seconds)
        self.account.received(data)
        self.reply(self.base.receive(data, self.seconds))

    def reply(self, data):
        if data is not None:
            for arrival in self.to_host.carry(self.seconds, data):
                self._later(arrival.delay, lambda data=arrival.datagram: self.hear(data))

    def hear(self, data, peer=BASE):
        """A datagram reaches the guard's socket."""
        if len(self._answers) < 32:
            self._answers.append((data, peer))

    def setsockopt(self, *_):
        """No kernel, no filter."""

    def getsockopt(self, *_):
        raise OSError(errno.ENOPROTOOPT, "no kernel")

    def recvfrom(self, _):
        if self.link_trouble is not None:
            raise self.link_trouble
        if not self._answers:
            raise BlockingIOError
        return self._answers.pop(0)

    def _later(self, delay, action):
        if delay > 0.0:
            self.after(delay, action)
        else:
            action()

    def _watch_base(self):
        self.base.advance(self.seconds)
        self.after(WATCH, self._watch_base)

    # The planner.

    def start_planner(self):
        self._planners += 1
        self.planner = PlannerLoop(self._planner_options, NOWHERE)
        self.planner._arm(self.now)
        self._arm_planner(self._planners)

    def kill_planner(self):
        self._planners += 1

    def _arm_planner(self, mine):
        self.at(self.planner._due_ns + LATE_NS, lambda: self._wake_planner(mine))

    def _wake_planner(self, mine):
        if mine != self._planners:
            return
        if self.now < self.planner_sleeps_until:
            self.at(self.planner_sleeps_until, lambda: self._wake_planner(mine))
            return
        self.planner._wake()
        ahead, self._ahead = self._ahead, 0
        due = max(self.planner._due_ns, self.now + ahead)
        self.at(due + LATE_NS, lambda: self._wake_planner(mine))

    def think(self, seconds):
        self._ahead += round(seconds * SECOND)

    def _when_thought(self, publish):
        mine = self._planners
        self.at(self.now + self._ahead, lambda: mine == self._planners and publish())

    def mind(self, cueing):
        return Mind(cueing, self)

    @property
    def inputs(self):
        return self.planner._inputs

    @property
    def heard(self):
        """What the planner has counted of its inputs."""
        return self.inputs.counters

    # The operator, and what the network does.

    def start(self):
        self.start_guard()
        self.start_planner()
        self.client.start()

    def ask(self, op, **more):
        self.requests["guard"].put({"op": op, "by": "console", **more})

    def engage(self):
        """Bring it up as an operator does."""
        self.until(lambda: self.state is State.PARKED, 3.0, "PARKED")
        self.run(0.1)
        self.ask("engage")
        self.until(lambda: self.state is State.RUN, 6.0, "RUN")

    def unplug_base(self):
        self.refuses_to_send = OSError(errno.ENETUNREACH, "network is unreachable")

    def plug_base(self):
        self.refuses_to_send = None

    def sleep(self, seconds, planner=True):
        """The computer, or the guard alone, stands still; the base's clock runs on."""
        until = self.now + round(seconds * SECOND)
        self.guard_sleeps_until = max(self.guard_sleeps_until, until)
        if planner:
            self.planner_sleeps_until = max(self.planner_sleeps_until, until)

    def digest(self):
        """Everything that was sent to the base and when, as one number."""
        told = hashlib.sha256()
        for instant, data in self.account.log.records:
            told.update(instant.to_bytes(8, "little") + data)
        return told.hexdigest()
