"""What a guard really played, rebuilt from the accepted plans and judged by other kinematics."""

import numpy as np
from own_kinematics import lengths, quintic_poses, worst

from motionserver.core.device import Order

PERIOD = 1 / 60
FINE = 1 / 500


class Executed:
    """Follows a bench tick by tick; `judge` tells which shares of the limits were used."""

    def __init__(self, bench):
        self.bench = bench
        self.time = 0.0
        self.frames = len(bench.sent)
        playback = bench.record.playback
        self.chain = [(-playback.clock, playback.playing.plan)]
        for accepted in playback.pending:
            self._append(accepted.plan)
        self.times = []
        self.sent = []

    def _append(self, plan):
        self.chain.append((self.chain[-1][0] + plan.takeover, plan))

    def tick(self):
        bench = self.bench
        bench.tick()
        playback = bench.record.playback
        newest = playback.newest.plan
        if newest is not self.chain[-1][1]:
            assert newest.parent_id == self.chain[-1][1].plan_id
            self._append(newest)
        if len(bench.sent) > self.frames:
            self.frames = len(bench.sent)
            assert bench.sent[-1].order is Order.FOLLOW
            self.time += PERIOD
            self.times.append(self.time)
            self.sent.append(bench.sent[-1])

    def poses(self, instants):
        """Poses played at instants (N,), increasing, of the guard's running time."""
        starts = np.array([start for start, _ in self.chain])
        which = np.searchsorted(starts, instants, side="right") - 1
        out = np.empty((len(instants), 6))
        for index in np.unique(which):
            mine = which == index
            start, plan = self.chain[index]
            out[mine] = quintic_poses(plan, instants[mine] - start)
        return out

    def judge(self, phase):
        """Shares of limits used at the send period and at 500 Hz; worst difference to the wire."""
        machine = self.bench.machine
        sent = np.array([setpoint.state.pose for setpoint in self.sent])
        legs = np.array([setpoint.legs for setpoint in self.sent])
        fine = np.arange(phase * FINE, self.time, FINE)
        rebuilt = self.poses(np.array(self.times))
        return {
            "wire": worst(machine, sent, PERIOD),
            "fine": worst(machine, self.poses(fine), FINE),
            "legs_off": float(np.abs(legs - lengths(machine, sent)).max()),
            "pose_off": float(np.abs(sent - rebuilt).max()),
            "setpoints": len(sent),
        }
