"""A perfect device and a guard on virtual time, for tests: pure, no sockets, no sleeping."""

import numpy as np
from own_kinematics import lengths

from motionserver.core.device import Feedback, Order, Phase
from motionserver.core.safety.act import Guard
from motionserver.core.safety.given import GuardConfig, Request, TickInput
from motionserver.core.safety.watchdog import CueStatus
from motionserver.core.state import DriveMode
from motionserver.cueing.governor import remainder

TICK_NS = 4_166_667
SEND_EVERY = 4


class Device:
    """Lifts and settles by itself within half a second; follows one frame late."""

    def __init__(self, machine):
        self.machine = machine
        self.low = lengths(machine, machine.parked_pose)[0] - 0.01
        self.neutral = lengths(machine, np.zeros(6))[0]
        self.legs = self.low
        self.phase = Phase.DOWN
        self.faults = ()
        self.held_faults = ()
        self.estop = False
        self.silent = False
        self.stuck = False
        self.mute = False
        self.unreachable = False
        self._frames = 0

    def put_up(self, pose):
        self.phase, self.legs = Phase.UP, lengths(self.machine, pose)[0]

    def take(self, setpoint):
        if setpoint.order is Order.RESET:
            self.faults = self.held_faults
        if self.estop:
            return
        if setpoint.order is Order.RAISE and self.phase is Phase.DOWN:
            self.phase, self._frames = Phase.RAISING, 30
        elif setpoint.order is Order.PARK and self.phase is Phase.UP:
            self.phase, self._frames = Phase.LOWERING, 30
        elif setpoint.order is Order.FOLLOW and self.phase is Phase.UP and not self.stuck:
            self.legs = setpoint.legs
        elif self.phase in (Phase.RAISING, Phase.LOWERING) and not self.stuck:
            self._frames -= 1
            if self._frames == 0:
                up = self.phase is Phase.RAISING
                self.phase = Phase.UP if up else Phase.DOWN
                self.legs = self.neutral if up else self.low

    def answer(self, now_ns):
        legs = None if self.mute else np.array(self.legs)
        state = self.phase.name
        return Feedback(now_ns, self.phase, state, legs, None, self.faults, self.estop)


class Bench:
    """Guard, device, source and planner in lock-step."""

    def __init__(self, machine, engage="console", plan_period=0.0125, **config):
        self.machine = machine
        self.config = GuardConfig(machine, 1 / 60, plan_period, engage, **config)
        self.guard = Guard(self.config)
        self.device = Device(machine)
        self.now = 1_000_000_000_000
        self.ticks = 0
        self.mode = DriveMode.DRIVE
        self.enabled = True
        self.source = True
        self.planning = True
        self.plan = self._remainder
        self.plan_every = 3
        self.sent = []
        self.seen = []
        self._cue_ns = 0
        self._answer = None
        self._numbers = 0

    @property
    def record(self):
        return self.guard.record

    @property
    def state(self):
        return self.record.state.value

    def number(self):
        self._numbers += 1
        return self._numbers

    def _remainder(self, playback):
        takeover = max(playback.newest_clock, 0.0) + 0.02
        return remainder(playback.newest.plan, takeover, self.number())

    def tick(self, *ops, by="console", leave=False, gap_ns=TICK_NS):
        """One tick after ``gap_ns``; returns the answers to the requests."""
        self.now += gap_ns
        self.ticks += 1
        if self.source:
            self._cue_ns = self.now
        feedback = () if self._answer is None else (self._answer,)
        self._answer = None
        playback = self.record.playback
        proposal = None
        if self.planning and self.ticks % self.plan_every == 0 and playback is not None:
            proposal = self.plan(playback)
        setpoint, answers = self.guard.tick(
            TickInput(
                self.now,
                gap_ns * 1e-9,
                self.ticks % SEND_EVERY == 0,
                feedback,
                CueStatus(self._cue_ns, 150_000_000, self.mode),
                proposal,
                tuple(Request(op, by, self.enabled) for op in ops),
                leave,
            )
        )
        if not self.seen or self.seen[-1] != self.state:
            self.seen.append(self.state)
        if setpoint is not None:
            self.guard.told(self.now, not self.device.unreachable)
        if setpoint is not None and not self.device.unreachable:
            self.sent.append(setpoint)
            self.device.take(setpoint)
            if not self.device.silent:
                self._answer = self.device.answer(self.now)
        return answers

    def run(self, seconds):
        for _ in range(round(seconds * 240)):
            self.tick()

    def until(self, state, seconds):
        """Tick until the state is reached; how long it took [s]."""
        begin = self.now
        while self.state != state:
            assert self.now - begin < seconds * 1e9, f"{self.state}: {self.record.reason}"
            self.tick()
        return (self.now - begin) * 1e-9

    def engaged(self, state="RUN"):
        """Bring it up from the start; returns itself."""
        self.until("PARKED", 1.0)
        self.tick()
        assert self.tick("engage", by=self.config.engage) == ("",)
        self.until(state, 5.0)
        return self
