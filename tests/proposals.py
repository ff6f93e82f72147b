"""Plan proposals for the campaign: real smooth plans, and every way of being wrong."""

from dataclasses import replace
from functools import cache

import numpy as np

from motionserver.core.axes import frozen
from motionserver.core.kinematics.hexapod import (
    conditioning,
    joint_angles,
    leg_lengths,
    neutral_conditioning,
)
from motionserver.core.motion.moves import straight_way
from motionserver.core.plan import Plan
from motionserver.cueing.governor import remainder

STILL = np.zeros(6)

# what is proposed, and how often
MIX = {
    "gentle": 0.13,
    "buzz": 0.02,
    "remainder": 0.02,
    "shake": 0.04,
    "snatch": 0.04,
    "dash": 0.03,
    "far": 0.01,
    "stranded": 0.07,
    "swung": 0.065,
    "singular": 0.06,
    "discontinuous": 0.085,
    "unstoppable": 0.09,
    "not finite": 0.08,
    "malformed": 0.08,
    "wrong parent": 0.08,
    "late": 0.08,
    "early": 0.02,
}
_KINDS = tuple(MIX)


class Proposer:
    """Makes one proposal after the other from a seed."""

    def __init__(self, machine, seed):
        self.machine = machine
        self.rng = np.random.default_rng(seed)
        self.made = dict.fromkeys(_KINDS, 0)
        self._draw = iter(())
        self._number = 0
        self._aims = goals(machine)

    def __call__(self, playback):
        self._number += 1
        kind = next(self._draw, None)
        if kind is None:
            self._draw = iter(self.rng.choice(_KINDS, 4096, p=list(MIX.values())))
            kind = next(self._draw)
        self.made[kind] += 1
        parent = playback.newest.plan
        takeover = max(playback.newest_clock, 0.0) + self.rng.uniform(0.004, 0.03)
        return getattr(self, "_" + kind.replace(" ", "_"))(parent, takeover)

    def _bridge(self, parent, takeover, goal, duration, wiggle=0.0, knots=None):
        """From the parent's state to rest at ``goal``, with smooth wiggles on the way."""
        count = int(self.rng.integers(2, 12)) if knots is None else knots
        count = min(count, int(duration / 0.009) + 1)
        start = parent.state(takeover)
        ends = frozen(np.stack((start.pose, goal)))
        speeds = frozen(np.stack((start.velocity, STILL)))
        bends = frozen(np.stack((start.acceleration, STILL)))
        line = Plan(
            self._number, parent.plan_id, takeover, frozen([0.0, duration]), ends, speeds, bends
        )
        if count <= 2 and not wiggle:
            return line
        times = np.linspace(0.0, duration, max(count, 6))
        tables = line.evaluate(times)
        s = times / duration
        first = 3 * s**2 * (1 - s) ** 2 * (1 - 2 * s)
        second = 6 * s * (1 - s) * (1 - 5 * s + 5 * s**2)
        size = 64 * wiggle * self.rng.normal(size=6) * self.machine.box
        shape = (s**3 * (1 - s) ** 3, first / duration, second / duration**2)
        pose, velocity, acceleration = (
            table + column[:, None] * size for table, column in zip(tables, shape, strict=True)
        )
        velocity[-1] = acceleration[-1] = 0.0
        return replace(
            line,
            times=frozen(times),
            pose=frozen(pose),
            velocity=frozen(velocity),
            acceleration=frozen(acceleration),
        )

    def _near(self, share):
        return self.rng.uniform(-share, share, 6) * self.machine.box

    def _gentle(self, parent, takeover):
        duration = self.rng.uniform(1.0, 3.8)
        return self._bridge(
            parent, takeover, self._near(0.28), duration, self.rng.choice([0.0, 0.05])
        )

    def _buzz(self, parent, takeover):
        """Knots as close as allowed, jerk that turns between the samples of a check."""
        duration, dt = self.rng.uniform(0.6, 1.2), self.rng.uniform(0.0081, 0.025)
        line = self._bridge(parent, takeover, parent.rest_pose, duration, knots=2)
        times = np.arange(int(duration / dt) + 1) * dt
        times[1:] -= dt - self.rng.choice([dt, 0.001, 0.004])
        tables = [np.array(table) for table in line.evaluate(times)]
        pushed = np.s_[1 : int(self.rng.integers(3, len(times)))]
        size = 200 * self.rng.uniform(0.1, 0.8) * (self.rng.random(6) < 0.4)
        for table, power in zip(tables, (3, 2, 1), strict=True):
            noise = self.rng.normal(size=table[pushed].shape) * self.rng.choice([0.0, 0.3])
            table[pushed] += noise * size * dt**power
        tables[1][-1] = tables[2][-1] = 0.0
        columns = dict(zip(("pose", "velocity", "acceleration"), map(frozen, tables), strict=True))
        return replace(line, times=frozen(times), **columns)

    def _remainder(self, parent, takeover):
        return remainder(parent, takeover, self._number)

    def _hop(self, parent, takeover, distance, duration):
        way = self.rng.normal(size=6) * self.machine.box
        here = parent.state(takeover).pose
        reach = np.abs(leg_lengths(self.machine, np.stack((here, here + way))))
        share = distance / np.abs(reach[1] - reach[0]).max()
        return self._bridge(parent, takeover, here + way * share, duration, knots=2)

    def _shake(self, parent, takeover):
        d = self.rng.uniform(0.01, 0.02)
        return self._hop(parent, takeover, d, (5.77 * d / self.rng.uniform(9, 14)) ** 0.5)

    def _snatch(self, parent, takeover):
        d = self.rng.uniform(0.03, 0.06)
        return self._hop(parent, takeover, d, (60 * d / self.rng.uniform(210, 280)) ** (1 / 3))

    def _dash(self, parent, takeover):
        d = self.rng.uniform(0.12, 0.2)
        aim = self.rng.choice([-1.0, 1.0]) * self.rng.uniform(0.3, 0.75)
        goal = np.array([0.0, 0.0, aim * self.machine.box[2], 0.0, 0.0, 0.0])
        return self._bridge(
            parent, takeover, goal, 1.875 * d / self.rng.uniform(0.62, 0.9), knots=2
        )

    def _far(self, parent, takeover):
        return self._bridge(parent, takeover, self._near(2.0), self.rng.uniform(2.0, 3.9))

    def _toward(self, name, parent, takeover):
        aims = self.rng.choice(self._aims[name], 6)
        goal = aims[np.abs((aims - parent.rest_pose) / self.machine.box).sum(1).argmin()]
        return self._bridge(parent, takeover, goal, self.rng.uniform(3.0, 3.9), knots=2)

    def _stranded(self, parent, takeover):
        return self._toward("stranded", parent, takeover)

    def _swung(self, parent, takeover):
        return self._toward("swung", parent, takeover)

    def _singular(self, parent, takeover):
        return self._toward("singular", parent, takeover)

    def _edited(self, plan, field, row, change):
        table = np.array(getattr(plan, field))
        axis = self.rng.integers(6)
        table[row, axis] = change(table[row, axis])
        return replace(plan, **{field: frozen(table)})

    def _any_field(self):
        return str(self.rng.choice(["pose", "velocity", "acceleration"]))

    def _discontinuous(self, parent, takeover):
        jump = 10.0 ** self.rng.uniform(-3.5, 1) * self.rng.choice([-1, 1])
        plan = self._gentle(parent, takeover)
        return self._edited(plan, self._any_field(), 0, lambda value: value + jump)

    def _unstoppable(self, parent, takeover):
        plan, jump = self._gentle(parent, takeover), 10.0 ** self.rng.uniform(-6, 1)
        field = str(self.rng.choice(["velocity", "acceleration"]))
        return self._edited(plan, field, -1, lambda value: value + jump)

    def _not_finite(self, parent, takeover):
        bad = self.rng.choice([np.nan, np.inf, -np.inf, 1e5, 1e300])
        plan = self._gentle(parent, takeover)
        if self.rng.random() < 0.2:
            return replace(plan, takeover=self.rng.choice([np.nan, np.inf, -np.inf]))
        row = int(self.rng.integers(len(plan.times)))
        return self._edited(plan, self._any_field(), row, lambda value: bad)

    def _malformed(self, parent, takeover):
        plan = self._bridge(parent, takeover, self._near(0.3), 2.0, knots=8)
        times = np.array(plan.times)
        which = self.rng.integers(6)
        if which == 0:
            times[3] = times[4]
        elif which == 1:
            times[[3, 4]] = times[[4, 3]]
        elif which == 2:
            times *= 4.001 / times[-1]
        elif which == 3:
            times[0] = self.rng.choice([-0.1, 1e-9])
        elif which == 4:
            times[3] = times[4] - self.rng.uniform(1e-6, 0.0079)
        else:
            plan = self._bridge(parent, takeover, self._near(0.3), 3.9, knots=257)
            times = np.array(plan.times)
        return replace(plan, times=frozen(times))

    def _wrong_parent(self, parent, takeover):
        plan = self._gentle(parent, takeover)
        if self.rng.random() < 0.1:
            return replace(plan, plan_id=plan.parent_id)
        return replace(plan, parent_id=int(self.rng.integers(1 << 62)))

    def _late(self, parent, takeover):
        back = takeover - 0.06 - 10.0 ** self.rng.uniform(-4, 1)
        return replace(self._gentle(parent, takeover), takeover=back)

    def _early(self, parent, takeover):
        return replace(self._gentle(parent, takeover), takeover=takeover + self.rng.uniform(0.6, 9))


@cache
def goals(machine):
    """Rest poses inside the stroke that only one rule forbids, reached straight from neutral."""
    rng = np.random.default_rng(20)
    poses = rng.uniform(-1.4, 1.4, (300_000, 6)) * machine.box
    legs = leg_lengths(machine, poses)
    inside = ((legs > machine.leg_min + 1e-3) & (legs < machine.leg_max - 1e-3)).all(1)
    out = {"stranded": [], "swung": [], "singular": []}
    for pose in poses[inside]:
        ways = [straight_way(machine, pose, home) for home in (STILL, machine.parked_pose)]
        home, parked = (
            max(machine.leg_min - way.legs.min(), way.legs.max() - machine.leg_max) for way in ways
        )
        if home > -1e-3:
            continue
        swing = joint_angles(machine, ways[0].poses).max() > machine.joint_angle
        ratio = conditioning(machine, ways[0].poses).min() / neutral_conditioning(machine)
        if swing:
            out["swung"].append(pose)
        elif ratio < machine.conditioning:
            out["singular"].append(pose)
        elif parked > 0.0:
            out["stranded"].append(pose)
    return out
