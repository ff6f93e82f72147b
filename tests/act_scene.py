"""A guard in a state, for one tick after the other."""

from dataclasses import replace

import numpy as np
from machines import compact
from own_kinematics import lengths

from motionserver.core.axes import frozen
from motionserver.core.device import Feedback, Phase
from motionserver.core.motion.moves import rest_to_rest
from motionserver.core.motion.player import Playback
from motionserver.core.safety.accept import accept_rest
from motionserver.core.safety.act import Guard
from motionserver.core.safety.given import GuardConfig, Request, TickInput
from motionserver.core.safety.states import State
from motionserver.core.safety.watchdog import CueStatus
from motionserver.core.state import DriveMode

MS = 1_000_000
SECOND = 1_000_000_000
PERIOD = 1 / 64
"""Of packets and of plans [s]."""
ZERO = frozen(np.zeros(6))
HOMES = np.stack((ZERO, compact().parked_pose))
NEUTRAL = lengths(compact(), ZERO)[0]
LIFTED = frozen([0.0, 0.0, 0.05, 0.0, 0.0, 0.0])


def at_rest(pose=ZERO, number=1):
    accepted = accept_rest(compact(), pose, number, HOMES)
    return Playback(accepted, accepted.plan.duration)


class Scene:
    """A guard in a state, a device that answers at every tick, and nothing else."""

    def __init__(self, state=State.OFFLINE, phase=Phase.UP, playback=None, **config):
        self.guard = Guard(GuardConfig(compact(), PERIOD, PERIOD, **config))
        self.record = self.guard.record
        self.record.state, self.record.playback = state, playback
        self.record.deadline_ns = 10**18
        self.now = self.record.since_ns = 10 * SECOND
        self.phase, self.answer = phase, {"legs": NEUTRAL}
        self.answers = self.drives = True

    def tick(self, ms=4, is_due=True, ops=(), proposal=None, ns=0, leave=False):
        self.now += ms * MS + ns
        answer = Feedback(self.now, self.phase, self.phase.name, **self.answer)
        cue = CueStatus(self.now, 150 * MS, DriveMode.DRIVE)
        self.record.accepted_ns = self.now if self.drives else self.record.accepted_ns
        setpoint, answers = self.guard.tick(
            TickInput(
                self.now,
                (ms * MS + ns) / 1e9,
                is_due,
                (answer,) if self.answers else (),
                cue,
                proposal,
                tuple(Request(op, "console") for op in ops),
                leave,
            )
        )
        assert len(answers) == len(ops)
        return setpoint

    def run(self, ms):
        for _ in range(ms // 4):
            self.tick()
        return self


def moving():
    """A move to 5 cm above neutral within two seconds, half a second under way."""
    rest = at_rest()
    child = rest_to_rest(2, 1, 0.0, ZERO, LIFTED, 2.0)
    accepted = child_of(rest, child)
    return Playback(accepted, 0.5)


def child_of(rest, plan):
    return replace(rest.newest, plan=plan, before=rest.newest.plan)
