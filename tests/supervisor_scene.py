"""A supervisor after a second in which all went as expected, and what can be done to it."""

import numpy as np
from machines import compact
from own_kinematics import lengths

from motionserver.core.axes import frozen
from motionserver.core.device import Feedback, Phase
from motionserver.core.motion.moves import rest_to_rest
from motionserver.core.motion.player import Playback
from motionserver.core.safety.record import GuardRecord
from motionserver.core.safety.states import State
from motionserver.core.safety.supervisor import Supervisor
from motionserver.core.safety.verdict import AcceptedPlan
from motionserver.core.safety.watchdog import CueStatus, Patience
from motionserver.core.state import DriveMode

MS = 1_000_000
PERIOD = 1 / 64
"""Of packets and of plans [s]: twice and three times it are exact in binary."""
ZERO = frozen(np.zeros(6))
NEUTRAL = lengths(compact(), ZERO)[0]
MOVE = AcceptedPlan(rest_to_rest(2, 1, 0.0, ZERO, frozen([0.01] * 6), 1.0), None, 1.0)
MOVING, RESTING = Playback(MOVE, 0.999), Playback(MOVE, 1.0)


class Scene:
    """A second has passed in which device, source and planner did all that is expected."""

    def __init__(self, state=State.RUN, phase=Phase.UP, **config):
        self.supervisor = Supervisor(compact(), Patience(), PERIOD, PERIOD, **config)
        self.record = GuardRecord(state, deadline_ns=10**18)
        self.now = 0
        self.phase, self.answer = phase, {"legs": NEUTRAL}
        self.mode = DriveMode.DRIVE
        self.talks = self.sends = self.plans = True
        self.run(1000)

    def tick(self, ms=10, *wishes, ns=0):
        """What follows after so long a gap."""
        gap_ns = ms * MS + ns
        self.now += gap_ns
        if self.talks:
            answer = Feedback(self.now, self.phase, self.phase.name, **self.answer)
            self.supervisor.device.answered(answer)
        status = CueStatus(self.now, 150 * MS, self.mode) if self.sends else None
        self.supervisor.heard(self.now, status, gap_ns / 1e9)
        if self.plans:
            self.record.accepted_ns = self.now
        return self.supervisor.step(self.record, self.now, gap_ns / 1e9, frozenset(wishes))

    def run(self, ms):
        """Ticks of 10 ms; what follows from the last one."""
        found = None
        for _ in range(ms // 10):
            found = self.tick()
        return found

    def reset(self, ms=2000):
        self.record.reset_until_ns = self.now + ms * MS
        return self
