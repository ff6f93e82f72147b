"""Guard, intake and the emulated Moog on one virtual clock: bytes on both wires, no sockets."""

import copy
from functools import cache

import numpy as np
from machines import compact
from motion_clients.moog_device import MoogDevice
from motion_clients.moog_judge import MoogJudge
from motion_clients.moog_machine import STEP
from motion_clients.moog_wire import MachineState
from motion_protocol import Cue, Flags, Mode, Motion, encode_cue
from own_kinematics import lengths, worst
from proposals import MIX, Proposer

from motionserver.core.device import Order
from motionserver.core.intake.gate import Gate
from motionserver.core.safety.act import Guard
from motionserver.core.safety.given import GuardConfig, Request, TickInput
from motionserver.core.safety.states import State
from motionserver.core.safety.supervisor import is_standing
from motionserver.core.safety.watchdog import CueStatus, Patience
from motionserver.platforms.base import PlatformOptions, PlatformPacketError
from motionserver.platforms.moog import Moog6Dof2000E
from motionserver.sources.base import SourceError
from motionserver.sources.native import NativeSource

PERIOD = 1 / 60
TICK_HZ = 120
TICK_NS = 8_333_333
SEND_EVERY = 2
PLAN_EVERY = 2
PACKET_EVERY = 1
LATCHED = (State.FAULT, State.SAFE)
RETRACTED = 0.9022
PATIENCE = Patience(silence=3.0)
"""As shipped, but nobody waits half a minute for a source."""
STILL = 0.002
"""A leg slower than this stands [m/s]."""
EVERY_WAY = ("stranded", "swung", "singular")
KINDS = tuple(kind for kind in MIX if kind not in EVERY_WAY)


class Proposals(Proposer):
    """The campaign's proposals, but for those that need a map of the workspace."""

    def __init__(self, machine, seed=1):
        self.machine, self.rng = machine, np.random.default_rng(seed)
        self._number = 0
        self.kinds = ("gentle",)

    def __call__(self, playback):
        self._number += 1
        parent = playback.newest.plan
        takeover = max(playback.newest_clock, 0.0) + self.rng.uniform(0.004, 0.03)
        kind = str(self.rng.choice(self.kinds))
        return getattr(self, "_" + kind.replace(" ", "_"))(parent, takeover)


class Scene:
    """A server and its base; `tick` lets 1/120 s pass."""

    def __init__(self):
        self.machine = compact()
        self.guard = Guard(GuardConfig(self.machine, PERIOD, 0.0125, patience=PATIENCE))
        self.wire = Moog6Dof2000E(PlatformOptions(length_offset=RETRACTED))
        self.base = MoogDevice(on_step=self._stepped)
        self.judge = MoogJudge(self.base.config)
        self.gate, self.source = Gate(), NativeSource()
        self.proposals = Proposals(self.machine)
        self.now = 1_000_000_000_000
        self.ticks = 0
        self.client, self.mode = "good", Mode.DRIVE
        self.planner = True
        self.to_base = self.to_host = True
        self.sequence = 0
        self.asked_ns = 0
        self.stretch, self.judged = [], 0
        self.sent, self.wild = [], []
        self.counted = dict.fromkeys(("late", "refused", "cut", "follows"), 0)
        self._steps = []
        self._last_legs = None
        self._answers = []
        self._followed_ns = 0
        self._stall = 0

    @property
    def record(self):
        return self.guard.record

    @property
    def state(self):
        return self.record.state

    def _stepped(self, instant, extensions, speeds):
        self._steps.append((instant, extensions, max(map(abs, speeds)), self.base.state))

    def stall(self, seconds):
        """The guard's own loop stands still for so long."""
        self._stall += round(seconds * 1e9)

    def cue(self, **wrong):
        """One packet of the client as bytes, through decoder and gate."""
        self.sequence += 1
        shift = wrong.pop("shift", 0)
        data = encode_cue(
            Cue(
                session=7,
                sequence=max(0, self.sequence - shift),
                sim_time_ns=self.now,
                sender_time_ns=self.now - wrong.pop("delay_ns", 0),
                motion=Motion((0.5, 0.0, 0.0), (0.0, 0.0, 0.0), attitude=(0.0, 0.0)),
                mode=self.mode,
                flags=Flags(0),
            )
        )
        self.heard(wrong.get("spoil", bytes)(data))

    def heard(self, data):
        try:
            motion = self.source.decode(data, self.now)
        except SourceError:
            self.counted["refused"] += 1
            return
        if self.gate.refuse("native", "127.0.0.1:1", motion) is not None:
            self.counted["refused"] += 1

    def tick(self, *ops):
        gap = TICK_NS + self._stall
        self._stall = 0
        self.now += gap
        self.ticks += 1
        if self.client == "good" and self.ticks % PACKET_EVERY == 0:
            self.cue()
        cue = proposal = None
        if self.planner and self.ticks % PLAN_EVERY == 0:
            fresh = self.gate.freshness
            cue = CueStatus(fresh.newest_ns or 0, fresh.stale_after_ns(), self.gate.mode)
            if self.record.playback is not None:
                proposal = self.proposals(self.record.playback)
        answers, self._answers = self._answers, []
        before, stood = self.state, is_standing(self.record.playback)
        setpoint, refusals = self.guard.tick(
            TickInput(
                self.now,
                gap * 1e-9,
                self.ticks % SEND_EVERY == 0,
                tuple(answers),
                cue,
                proposal,
                tuple(Request(op, "console") for op in ops),
            )
        )
        if "reset" in ops and not refusals[ops.index("reset")]:
            self.asked_ns = self.now
        if before in LATCHED and self.state not in (before, State.SAFE):
            if self.now - self.asked_ns > 2_000_000_000 or not self.asked_ns:
                self.wild.append(f"{before} -> {self.state} without an operator's reset")
            if not stood:
                self.wild.append(f"{before} -> {self.state} in motion")
        if before is State.PARKED and self.state is State.RAISING and "engage" not in ops:
            self.wild.append("raised without an operator")
        if setpoint is not None:
            self._send(setpoint)
        return refusals

    def run(self, seconds):
        for _ in range(max(1, round(seconds * TICK_HZ))):
            self.tick()

    def until(self, state, seconds):
        for _ in range(round(seconds * TICK_HZ)):
            if self.state is state:
                return self
            self.tick()
        raise AssertionError(f"{self.state}, not {state}: {self.record.reason}")

    def _send(self, setpoint):
        datagram = self.wire.encode(setpoint)
        if setpoint.order is Order.FOLLOW:
            self._followed_ns = self.now
            self.counted["follows"] += 1
            self.stretch.append(setpoint)
            playback = self.record.playback
            if playback is None:
                self.wild.append("follows without an accepted plan")
        else:
            self.account()
            self.stretch, self.judged = [], 0
        instant = self.now * 1e-9
        self.base.advance(instant)
        # judged as sent: what a broken cable swallows is not the host's jump
        self.judge.observe(datagram, instant, self.base)
        if self.to_base:
            reply = self.base.receive(datagram, instant)
            if reply is not None and self.to_host:
                try:
                    self._answers.append(self.wire.decode(reply, self.now))
                except PlatformPacketError as error:
                    self.wild.append(str(error))

    def account(self):
        """Judge what was sent since the last time by other kinematics, and what the base did."""
        if len(self.stretch) > self.judged:
            new = self.stretch[max(0, self.judged - 3) :]
            poses = np.array([setpoint.state.pose for setpoint in new])
            legs = np.array([setpoint.legs for setpoint in new])
            self.judged = len(self.stretch)
            assert np.abs(legs - lengths(self.machine, poses)).max() < 1e-9
            used = worst(self.machine, poses, PERIOD)
            assert max(used.values()) <= 1.0, used
        self._watch()
        assert not self.wild, self.wild
        assert self.judge.violations == 0, self.judge.summary(self.base)["first_violations"]

    def _watch(self):
        """The base's own log: inside its stroke, continuous, and led by nobody but the guard."""
        config = self.base.config
        steps, self._steps = self._steps, []
        for instant, extensions, speed, state in steps:
            assert all(-1e-6 <= e <= config.geometry.stroke + 1e-6 for e in extensions)
            if self._last_legs is not None:
                moved = max(abs(b - a) for a, b in zip(self._last_legs, extensions, strict=True))
                assert moved <= config.leg_speed * STEP + 1e-9, "the base's legs jumped"
            self._last_legs = extensions
            # what it is told plays over two frames, and a servo needs a moment to come to rest
            told = instant - self._followed_ns * 1e-9 < 0.5
            assert told or state is not MachineState.ENGAGED or speed < STILL, "led by nobody"

    @property
    def is_moving(self):
        return not self.base.is_at_rest

    def clone(self):
        """The same world again, machine shared: its tables are worth keeping."""
        return copy.deepcopy(self, {id(self.machine): self.machine})


@cache
def scene_in(state):
    """A world that was brought there in order; to be cloned."""
    scene = Scene().until(State.PARKED, 3.0)
    if state is not State.PARKED:
        scene.run(0.2)
        assert scene.tick("engage") == ("",)
        scene.until(state, 8.0)
    scene.account()
    return scene
