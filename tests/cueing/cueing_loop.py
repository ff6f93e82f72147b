"""Plays an algorithm in lock-step: propose, govern, verify, adopt, play."""

from dataclasses import dataclass, field

import numpy as np

from motionserver.core.axes import GRAVITY
from motionserver.core.kinematics.hexapod import leg_lengths
from motionserver.core.kinematics.rotation import felt
from motionserver.core.plan import rest_at
from motionserver.core.safety.verify import PLANNER_MARGINS, judge
from motionserver.core.state import Stimulus
from motionserver.cueing.governor import govern


@dataclass
class Played:
    pose: list = field(default_factory=list)
    velocity: list = field(default_factory=list)
    acceleration: list = field(default_factory=list)
    kappas: list = field(default_factory=list)
    candidates: list = field(default_factory=list)
    starts: list = field(default_factory=list)

    def felt(self, machine):
        tables = (np.concatenate(t) for t in (self.pose, self.velocity, self.acceleration))
        force, rates = felt(*tables, machine.head)
        return force - np.array([0.0, 0.0, GRAVITY]), rates

    def violations(self, machine):
        """Samples at 500 Hz outside any leg limit, by finite differences."""
        legs = leg_lengths(machine, np.concatenate(self.pose))
        count = int(((legs < machine.leg_min) | (legs > machine.leg_max)).sum())
        moved = legs
        for limit in (machine.leg_speed, machine.leg_acceleration, machine.leg_jerk):
            moved = np.diff(moved, axis=0) / 0.002
            count += int((np.abs(moved) > limit).sum())
        return count


def stimulus_of(force, rates=(0.0, 0.0, 0.0), preview=None):
    return Stimulus(np.array(force, dtype=float), np.array(rates, dtype=float), 1.0, preview)


def play(machine, cueing, stimuli, period=0.01, on_tick=None):
    """Run through stimuli, one a tick."""
    parent, before, out = rest_at(np.zeros(6)), None, Played()
    for tick, stimulus in enumerate(stimuli):
        if on_tick is not None:
            on_tick(tick)
        start = parent.state(period)
        candidate = cueing.propose(start, parent, period, stimulus)
        proposal = govern(
            candidate,
            parent,
            period,
            tick + 1,
            lambda plan, p=parent, b=before: judge(machine, plan, p, b, PLANNER_MARGINS),
        )
        cueing.adopt(proposal.plan, proposal.kappa)
        for table, values in zip(
            (out.pose, out.velocity, out.acceleration),
            parent.evaluate(np.arange(round(period / 0.002)) * 0.002),
            strict=True,
        ):
            table.append(values)
        out.kappas.append(proposal.kappa)
        out.candidates.append(candidate)
        out.starts.append(start)
        before, parent = parent, proposal.plan
    return out
