"""Cheap junk for the guard: a genuine plan's bytes with one thing wrong, and bytes that are none.

Now and then the genuine plan itself, so that the platform keeps moving and the junk continues
something real.
"""

import math
import random
import struct
from collections import Counter
from itertools import pairwise

import numpy as np
from proposals import Proposer

from motionserver.core.plan import pack, unpack

HEAD, ROW = 32, 152
EVERY = 12
"""Proposals from one genuine plan to the next."""
LEAD = 0.06
"""How far ahead a genuine plan takes over [s]: more than the ticks until it is proposed."""
HOSTILE = (
    math.nan, math.inf, -math.inf, 1e308, -1e308, 1e300, 1.8e19, -1e5, 1e4 * 1.001, 5.3e153,
)  # fmt: skip
# what is made, and how often; "maybe" may turn out legal, all else is wrong by construction
MIX = {
    "noise": 6,
    "noise_behind_head": 3,
    "cut": 6,
    "longer": 3,
    "miscounted": 6,
    "one_knot": 3,
    "many_knots": 3,
    "hostile": 14,
    "hostile_takeover": 4,
    "hostile_time": 5,
    "wrong_parent": 7,
    "own_parent": 2,
    "replayed": 3,
    "late": 7,
    "early": 4,
    "jump": 9,
    "not_at_rest": 8,
    "too_long": 4,
    "unordered": 5,
    "too_close": 4,
    "begins_late": 3,
    "byte_order": 3,
    "far": 2,
    "maybe": 2,
}


class Junk:
    """Proposals one after the other, by a seed.

    Attributes:
        made: How many of each kind.
        unreadable: How many were no plan at all.
        kind: Of the newest; "genuine" for a plan that may be taken.
    """

    def __init__(self, machine, seed, every=EVERY, lead=LEAD):
        self._every, self._lead = every, lead
        self.rng = random.Random(seed)
        self.made = Counter()
        self.unreadable = 0
        self.kind = ""
        self._genuine = Proposer(machine, seed)
        self._kinds = [kind for kind, share in MIX.items() for _ in range(share)]
        self._step = 0
        self._plan = None
        self._old = b""
        self._clock = 0.0
        self._parent = None

    def __call__(self, playback):
        """What the guard finds in the planner's file: a plan, or None if it is unreadable."""
        self._clock = playback.newest_clock
        self._parent = playback.newest.plan
        step, self._step = self._step, (self._step + 1) % self._every
        if step == 0 or self._plan is None:
            self._plan = bytes(self._continued(max(self._clock + self._lead, 0.004)))
        if step == self._every - 1:
            self.kind, data = "genuine", self._plan
            self._old = data
        else:
            self.kind = self.rng.choice(self._kinds)
            data = bytes(getattr(self, "_" + self.kind)(bytearray(self._plan)))
        self.made[self.kind] += 1
        try:
            return unpack(data)
        except ValueError:
            self.unreadable += 1
            return None

    # Bytes that are no plan.

    def _noise(self, data):
        return self.rng.randbytes(
            self.rng.choice((0, 1, 31, 32, 184, 336, self.rng.randrange(3000)))
        )

    def _noise_behind_head(self, data):
        data[HEAD:] = self.rng.randbytes(len(data) - HEAD)
        return data

    def _cut(self, data):
        return data[: self.rng.randrange(len(data))]

    def _longer(self, data):
        return data + self.rng.randbytes(self.rng.choice((1, 8, 151)))

    def _miscounted(self, data):
        count = self._knots(data)
        wrong = self.rng.choice((0, count - 1, count + 1, 257, 1025, 2**31, 2**32 - 1))
        struct.pack_into("<I", data, 24, wrong)
        return data

    # Plans with one thing wrong.

    def _one_knot(self, data):
        struct.pack_into("<I", data, 24, 1)
        return data[: HEAD + ROW]

    def _many_knots(self, data):
        more = self.rng.choice((257, 300, 1024)) - self._knots(data)
        struct.pack_into("<I", data, 24, self._knots(data) + more)
        return data + data[-ROW:] * more

    def _hostile(self, data):
        return self._put(data, self._row(data), self.rng.randrange(1, 19), self._wild())

    def _hostile_takeover(self, data):
        return self._take_over(data, self._wild())

    def _hostile_time(self, data):
        return self._put(data, self._row(data), 0, self._wild())

    def _wrong_parent(self, data):
        parent = struct.unpack_from("<Q", data, 8)[0]
        wrong = self.rng.choice((parent - 1, parent + 1, 0, 2**64 - 1, self.rng.getrandbits(64)))
        struct.pack_into("<Q", data, 8, wrong % 2**64 if wrong % 2**64 != parent else parent ^ 1)
        return data

    def _own_parent(self, data):
        data[0:8] = data[8:16]
        return data

    def _replayed(self, data):
        return bytearray(self._old) or self._wrong_parent(data)

    def _late(self, data):
        """Continues its parent as it should, at an instant that has passed."""
        if self._clock > 0.0035 and self.rng.random() < 0.5:
            return self._continued(self.rng.uniform(0.0031, self._clock - 1e-6))
        return self._take_over(data, max(self._clock, 0.0) - 10.0 ** self.rng.uniform(-6, 3))

    def _early(self, data):
        wait = 0.5 + 10.0 ** self.rng.uniform(-6, 3)
        if self.rng.random() < 0.5:
            return self._continued(max(self._clock, 0.0) + wait)
        return self._take_over(data, self._clock + wait)

    def _jump(self, data):
        """Larger than any tolerance of the hand-over; at times as large as the platform."""
        column = self.rng.randrange(1, 19)
        return self._add(data, 0, column, self._sign(10.0 ** self.rng.uniform(-3.6, 3)))

    def _not_at_rest(self, data):
        last, column = self._knots(data) - 1, self.rng.randrange(7, 19)
        return self._add(data, last, column, self._sign(10.0 ** self.rng.uniform(-8.5, 3)))

    def _too_long(self, data):
        times = self._times(data)
        longest = 4.0 + 10.0 ** self.rng.uniform(-6, 6)
        return self._retimed(data, [time * longest / times[-1] for time in times])

    def _unordered(self, data):
        times = self._times(data)
        row = self.rng.randrange(len(times) - 1)
        if self.rng.random() < 0.5:
            times[row + 1] = times[row]
        else:
            times[row], times[row + 1] = times[row + 1], times[row]
        return self._retimed(data, times)

    def _too_close(self, data):
        """One knot more, on the same way; the first step may be 0.1 ms, every later one 8 ms."""
        times, plan = self._times(data), unpack(self._plan)
        row = self.rng.randrange(len(times) - 1)
        least = min(1e-4 if row == 0 else 0.008, times[row + 1] - times[row])
        time = times[row] + self.rng.uniform(0.05, 0.95) * least
        tables = plan.evaluate(np.array([time]))
        struct.pack_into("<I", data, 24, len(times) + 1)
        at = HEAD + ROW * (row + 1)
        data[at:at] = struct.pack("<19d", time, *(value for table in tables for value in table[0]))
        return data

    def _begins_late(self, data):
        return self._put(data, 0, 0, self._sign(10.0 ** self.rng.uniform(-12, -1)))

    def _byte_order(self, data):
        for at in range(HEAD, len(data), 8):
            data[at : at + 8] = data[at : at + 8][::-1]
        return data

    def _far(self, data):
        """Within what kinematics can compute, beyond what any leg reaches."""
        row = self.rng.randrange(1, self._knots(data))
        return self._put(data, row, self.rng.randrange(1, 4), self._sign(self.rng.uniform(5, 9999)))

    def _maybe(self, data):
        """Some bits or fields turned over anywhere: now and then that is a plan as good."""
        for _ in range(self.rng.choice((1, 1, 2, 8))):
            at = self.rng.randrange(len(data))
            if self.rng.random() < 0.7:
                data[at] ^= 1 << self.rng.randrange(8)
            else:
                at = at // 8 * 8
                data[at : at + 8] = data[at : at + 8][::-1]
        return data

    def _continued(self, takeover):
        """A genuine plan that takes over at ``takeover`` [s]."""
        self._genuine._number += 1
        return bytearray(pack(self._genuine._gentle(self._parent, takeover)))

    # How a plan is written: 32 bytes, then rows of time, pose, velocity, acceleration.

    def _knots(self, data):
        return (len(data) - HEAD) // ROW

    def _row(self, data):
        return self.rng.randrange(self._knots(data))

    def _put(self, data, row, column, value):
        struct.pack_into("<d", data, HEAD + ROW * row + 8 * column, value)
        return data

    def _add(self, data, row, column, value):
        now = struct.unpack_from("<d", data, HEAD + ROW * row + 8 * column)[0]
        return self._put(data, row, column, now + value)

    def _take_over(self, data, value):
        struct.pack_into("<d", data, 16, value)
        return data

    def _times(self, data):
        rows = range(self._knots(data))
        return [struct.unpack_from("<d", data, HEAD + ROW * row)[0] for row in rows]

    def _retimed(self, data, times):
        for row, time in enumerate(times):
            self._put(data, row, 0, time)
        return data

    def _wild(self):
        return self.rng.choice(HOSTILE)

    def _sign(self, value):
        return value if self.rng.random() < 0.5 else -value


def faults(plan, parent, clock):
    """What forbids a plan that was taken, by hand from the contract; empty if nothing does."""
    found = []
    if plan.parent_id != parent.plan_id or plan.plan_id == parent.plan_id:
        found.append("parent")
    if not max(clock, 0.0) <= plan.takeover <= clock + 0.5:
        found.append("instant")
    cells = [
        value
        for table in (plan.times, plan.pose, plan.velocity, plan.acceleration)
        for value in table.flat
    ]
    if not all(map(math.isfinite, cells)):
        found.append("finite")
    times = list(plan.times)
    steps = [later - earlier for earlier, later in pairwise(times)]
    if not 2 <= len(times) <= 256 or times[0] != 0.0 or times[-1] > 4.0:
        found.append("times")
    if min(steps, default=0.0) < 1e-4 - 1e-8 or min(steps[1:], default=1.0) < 0.008 - 1e-8:
        found.append("steps")
    if max(map(abs, (*plan.velocity[-1], *plan.acceleration[-1]))) > 1e-9:
        found.append("rest")
    return found
