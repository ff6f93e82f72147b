"""Scenes of the guard that several test files play."""

import itertools

import numpy as np
import pytest
from device_model import Bench
from machines import compact
from own_kinematics import lengths, worst
from proposals import goals

from motionserver.core.device import Order
from motionserver.core.kinematics.hexapod import joint_angles
from motionserver.core.motion.moves import rest_to_rest
from motionserver.core.safety.act import Guard
from motionserver.core.safety.inherit import inherit
from motionserver.core.safety.will import WillWriter, unpack_will, will_of
from motionserver.core.state import DriveMode

SEND_NS = 16_666_667


def bench(**config):
    return Bench(compact(), **config)


def away(b, goal=(0.05, 0.02, -0.04, 0.05, 0.04, -0.06), duration=2.0):
    """Let the planner go to a pose and stay there."""
    mine = []

    def plan(playback):
        newest = playback.newest.plan
        if newest.plan_id in mine:
            b.plan = b._remainder
            return b.plan(playback)
        mine.append(b.number())
        takeover = max(playback.newest_clock, newest.duration) + 0.02
        return rest_to_rest(
            mine[-1], newest.plan_id, takeover, newest.rest_pose, np.array(goal), duration
        )

    b.plan = plan
    b.run(duration + 0.3)
    return np.array(goal)


def legal(b):
    """Every emitted setpoint lies inside the limits, by other kinematics."""
    for order, run in itertools.groupby(b.sent, lambda setpoint: setpoint.order):
        sent = list(run)
        poses = np.array([s.state.pose for s in sent])
        legs = np.array([s.legs for s in sent])
        assert legs == pytest.approx(lengths(b.machine, poses), abs=1e-12)
        if order is Order.FOLLOW:
            assert max(worst(b.machine, poses, 1 / 60).values()) <= 1.0


def swung():
    """The pose inside the stroke whose joints swing furthest."""
    poses = np.array(goals(compact())["swung"])
    return poses[joint_angles(compact(), poses).max((1, 2)).argmax()]


STATES = ["RAISING", "READY", "RUN", "HOLD", "PARKING"]


def in_state(state):
    b = Bench(compact())
    if state in ("RAISING", "READY"):
        b.mode = DriveMode.PAUSE
        b.engaged(state)
        b.run(0.1)
        return b
    b.engaged()
    away(b)
    if state == "HOLD":
        b.mode = DriveMode.PAUSE
        b.until("HOLD", 0.5)
        b.run(0.3)
    if state == "PARKING":
        b.tick("park")
        b.run(0.3)
    assert b.state == state
    return b


def stands(b, seconds=5.0):
    """Once the accepted plan is over, nothing is followed any more."""
    b.run(seconds)
    count = len(b.sent)
    b.run(2.0)
    assert Order.FOLLOW not in {s.order for s in b.sent[count:]}
    legal(b) if any(s.order is Order.FOLLOW for s in b.sent) else None


def written(b, taken_ns=0):
    """What the guard writes with the packet it has just sent, through bytes and back."""
    sent = len(b.sent)
    while len(b.sent) == sent:
        b.tick()
    newest = b.guard.supervisor.device.newest
    will = will_of(b.record, newest, taken_ns, b.now + SEND_NS)
    return unpack_will(WillWriter().pack(will))


def die(b, gap=0.0, taken_ns=0):
    """The guard ends after a packet, another takes its place; whether it went on."""
    will = written(b, taken_ns)
    b.now += round(gap * 1e9)
    b.guard = Guard(b.config)
    return inherit(b.guard, will, b.now)
