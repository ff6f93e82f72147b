"""What was sent and what the base did, judged by the base's judge and by other kinematics."""

import numpy as np
from fittings import SECOND
from motion_clients.moog_judge import JudgedLimits, MoogJudge
from motion_clients.moog_machine import STEP
from motion_clients.moog_wire import MachineState, Mcw, decode_command
from motion_clients.motion_log import MotionLog
from own_kinematics import lengths, worst

from motionserver.core.device import Order
from motionserver.core.safety.states import State

PERIOD = 1 / 60
RETRACTED = 0.9022
LATCHED = (State.FAULT, State.SAFE)
STILL = 0.002
"""A leg slower than this stands [m/s]."""
LED = 0.5
"""So long after a position a leg may still move [s]: it plays over two frames, servos settle."""


class Account:
    """Notes everything; `problems` tells what was wrong, as sentences."""

    def __init__(self, world, config):
        self.world, self.config = world, config
        self.log = MotionLog(kept=10_000)
        self.judge = MoogJudge(config)
        self.at_base = MoogJudge(config, JudgedLimits(may_lose=True))
        self.wire_may_reorder = False
        self.base_moves_itself = False
        self.wild = []
        self.states = []
        self.refusals = []
        self._granted_ns = -10 * SECOND
        self._stretches = []
        self._is_following = False
        self._followed = -1e9
        self._instants, self._legs, self._speeds, self._ups = [], [], [], []
        self._leds = []

    def sent(self, data, setpoint):
        """A datagram leaves the server, as it was sent."""
        world = self.world
        self.log.write(world.now, data)
        self.judge.observe(data, world.seconds, world.base)
        command = decode_command(data)
        follows = command.mcw == Mcw.NEW_POSITION
        if follows is not (setpoint.order is Order.FOLLOW):
            self.wild.append(f"{setpoint.order} went out as {command.mcw}")
        pairs = zip(command.words, setpoint.legs, strict=True)
        off = max(abs(word + RETRACTED - leg) for word, leg in pairs)
        if off > 1e-6:
            self.wild.append(f"words are {off:.2e} m off their setpoint")
        if follows and not self._is_following:
            self._stretches.append([])
        self._is_following = follows
        if follows:
            self._stretches[-1].append((setpoint.state.pose, setpoint.legs))

    def received(self, data):
        """A datagram reaches the base."""
        world = self.world
        self.at_base.observe(data, world.seconds, world.base)
        if decode_command(data).mcw == Mcw.NEW_POSITION:
            self._followed = world.seconds

    def stepped(self, instant, extensions, speeds):
        self._instants.append(instant)
        self._legs.append(extensions)
        self._speeds.append(max(map(abs, speeds)))
        self._ups.append(self.world.base.state is MachineState.ENGAGED)
        self._leds.append(self._followed)

    def woken(self, before, stood):
        """The guard has ticked: which state it came from, whether it stood, by whose edge."""
        world, state = self.world, self.world.state
        if not self.states or self.states[-1][1] is not state:
            self.states.append((world.now, state))
        answers = world.requests["guard"].answers
        granted = any(answer["ok"] for _, answer in answers)
        self.refusals += [answer["reason"] for _, answer in answers if not answer["ok"]]
        answers.clear()
        if granted:
            self._granted_ns = world.now
        if state is before:
            return
        if before in LATCHED and state not in LATCHED:
            if world.now - self._granted_ns > 2 * SECOND:
                self.wild.append(f"{before} -> {state} without an operator's reset")
            if not stood:
                self.wild.append(f"{before} -> {state} in motion")
        if before is State.PARKED and state is State.RAISING and not granted:
            self.wild.append("raised without an operator")

    def problems(self):
        """Everything that was wrong so far."""
        out = list(self.wild)
        world = self.world
        if self.judge.violations:
            out.append(f"sent: {self.judge.summary(world.base)['first_violations'][:2]}")
        if self.at_base.violations and not self.wire_may_reorder:
            out.append(f"received: {self.at_base.summary(world.base)['first_violations'][:2]}")
        for stretch in self._stretches:
            poses, legs = (np.array(table) for table in zip(*stretch, strict=True))
            off = np.abs(legs - lengths(world.machine, poses)).max()
            used = worst(world.machine, poses, PERIOD)
            if off > 1e-9 or max(used.values()) > 1.0:
                out.append(f"other kinematics: legs {off:.1e} m off, limits used {used}")
        return out + self._base_problems()

    def _base_problems(self):
        """The base's own log: inside its stroke, continuous, led by nobody but the server."""
        legs, out = np.array(self._legs), []
        stroke = self.config.geometry.stroke
        if legs.min() < -1e-6 or legs.max() > stroke + 1e-6:
            out.append("a leg left its stroke")
        if np.abs(np.diff(legs, axis=0)).max() > self.config.leg_speed * STEP + 1e-9:
            out.append("the base's legs jumped")
        alone = np.array(self._instants) - np.array(self._leds) > LED
        if (
            not self.base_moves_itself
            and (alone & np.array(self._ups) & (np.array(self._speeds) > STILL)).any()
        ):
            out.append("the base moved, led by nobody")
        return out

    @property
    def violations(self):
        own = 0 if self.wire_may_reorder else self.at_base.violations
        return self.judge.violations + own

    @property
    def ended_safe(self):
        return bool(self.judge.summary(self.world.base)["ended_safe"])
