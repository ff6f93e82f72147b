"""Faults of the planner, its solver, its tuning and its neighbours: F14 to F16, F21, F28, F30."""

import math
from dataclasses import replace

import numpy as np
import stated
from fittings import NOWHERE
from machines import compact
from scenario import SEND, TICK, Fault

from motionserver.cueing.registry import algorithms
from motionserver.telemetry.recorder import Recorder

PERIODS = 3
"""Planner periods without an accepted plan that are borne."""


class NoPlan(Fault):
    """No plan is accepted any more; what follows is judged from the last one that was."""

    def look(self):
        if self.struck_ns is None or self.reacted_ns is None:
            self._accepted_ns = self.world.record.accepted_ns
        super().look()

    def onset_ns(self):
        return self._accepted_ns

    def reacted(self):
        return self.has_left_run

    def bound(self):
        return PERIODS * self.world.period + 2 * TICK


class F14(NoPlan):
    number = 14
    title = "the problem has no solution"
    detection = "solver's status"
    reaction = stated.NO_SOLUTION
    recovery = "automatic"

    def __init__(self, world, rng):
        super().__init__(world, rng)
        self.seconds = rng.choice((rng.uniform(0.2, 1.3), rng.uniform(2.2, 3.0)))
        self.returns = self.seconds < 1.4

    def strike(self):
        self.world.spoilers.append(self._spoil)

    def _spoil(self, candidate):
        return None

    def relent(self):
        self.world.spoilers.remove(self._spoil)


class F15(F14):
    number = 15
    title = "solver gives NaN, raises, or takes too long"
    detection = "finite numbers; what it raises; the hand-over that has passed"
    reaction = "as F14"

    def __init__(self, world, rng):
        super().__init__(world, rng)
        self.kind = rng.choice(("nan", "raises", "late"))
        self.long = rng.uniform(0.2, 0.5)

    def _spoil(self, candidate):
        if self.kind == "raises":
            raise FloatingPointError("the factorisation broke down")
        if self.kind == "late":
            self.world.think(self.long)
            return candidate
        pose = np.array(candidate.pose)
        pose[self.rng.randrange(len(pose)), self.rng.randrange(6)] = self.rng.choice(
            (math.nan, math.inf)
        )
        return replace(candidate, pose=pose)

    def relent(self):
        super().relent()
        if self.kind == "late":
            self.returns = False


class F16(Fault):
    number = 16
    title = "plans out of reach or singular"
    detection = "legs, joint angles, conditioning, way home of every plan, twice"
    reaction = "rejected; the accepted plan goes on and comes to rest"
    recovery = "automatic"

    def __init__(self, world, rng):
        super().__init__(world, rng)
        self.is_blind = rng.random() < 0.5
        self.stays = not self.is_blind
        self.goal = np.array([rng.uniform(-1, 1) * size for size in (2, 2, 1.5, 2, 2, 3)])

    def strike(self):
        self._rejected = self.world.counters["plans_rejected"]
        self._refused = self._refusals()
        self.world.spoilers.append(self._spoil)
        if self.is_blind:
            # a planner that checks nothing: the guard is alone
            self.world.patch.setattr("motionserver.cueing.think.judge", lambda *_: None)

    def _refusals(self):
        return self.world.planner._view._counters["plans_refused"]

    def _spoil(self, candidate):
        pose = np.array(candidate.pose)
        pose[1:] += self.goal * np.linspace(0.1, 1.0, len(pose) - 1)[:, None]
        return replace(candidate, pose=pose)

    def relent(self):
        from motionserver.core.safety.verify import judge

        self.world.spoilers.remove(self._spoil)
        self.world.patch.setattr("motionserver.cueing.think.judge", judge)

    def reacted(self):
        if self.is_blind:
            return self.world.counters["plans_rejected"] > self._rejected
        return self._refusals() > self._refused

    def bound(self):
        return 2 * self.world.period + self.world.thinking + 2 * TICK


class F21(NoPlan):
    number = 21
    title = "planner crashes, is killed or stands still"
    detection = stated.NO_PLAN
    reaction = stated.TO_REST
    recovery = stated.REPLACED

    def __init__(self, world, rng):
        super().__init__(world, rng)
        self.seconds = rng.choice((rng.uniform(0.3, 1.2), rng.uniform(2.2, 3.0)))
        self.returns = self.seconds < 1.3

    def strike(self):
        self.world.kill_planner()

    def relent(self):
        self.world.start_planner()


class F28(Fault):
    number = 28
    title = "bad tuning: out of range, NaN, half, flapping"
    detection = stated.CHANGES
    reaction = "refused with the reason, the last good stays; what is good is ramped"
    recovery = "undo"
    stays = True

    def strike(self):
        self._goes_on = True
        self._accepted = 0
        self._tune()

    def _tune(self):
        if not self._goes_on:
            return
        rng, version = self.rng, self.world.planner._tuner._book.version
        changes = rng.choice(
            (
                {"scale": rng.choice((math.nan, math.inf, -1.0, 2.0, "0.5", None, [0.5]))},
                {"horizon": -1.0},
                {"box": [9.0] * 6},
                {"nonsense": 1},
                ["scale"],
                {"scale": rng.uniform(0.1, 1.0)},
                {"scale": rng.uniform(0.1, 1.0), "gain": rng.uniform(0.1, 1.0)},
                {"algorithm": rng.choice((*algorithms(), "cheating"))},
            )
        )
        message = {"op": "tune", "if_version": version, "changes": changes}
        half = rng.choice((message, message, {"op": "tune"}, {"op": "undo"}, b"{'op':", None))
        self.world.requests["planner"].put(half, "page")
        self.world.after(0.02, self._tune)

    def relent(self):
        self._goes_on = False

    def reacted(self):
        answers = [answer for _, answer in self.world.requests["planner"].answers]
        return any(not answer["ok"] for answer in answers)

    def bound(self):
        # the first may have been a good one, and so on
        return 1.0

    def check(self):
        book = self.world.planner._tuner._book
        tuning = book.tuning
        changed = book.version - 1
        most = 2 * (self.seconds + 2.0)
        out = [] if changed <= most else [f"F28: {changed} changes in {self.seconds:.1f} s"]
        fine = 0.0 <= tuning.scale <= 1.0 and tuning.algorithm in algorithms()
        return out if fine else [*out, f"F28: {tuning}"]


class F30(Fault):
    number = 30
    title = "disk full, read-only or slow"
    detection = "what writing raises"
    reaction = "the record ends, the tuning is not kept; nothing waits for a disk"
    recovery = "automatic"
    stays = True

    def strike(self):
        recorder = Recorder(self.world.files, compact(), algorithms())
        self._failed = 0
        self._goes_on = True

        def look():
            row = recorder.look()
            if row is not None:
                self._failed += 1
            if self._goes_on:
                self.world.after(0.004, look)

        look()
        # the tuning's own file cannot be written: it lies nowhere
        assert not NOWHERE.exists()
        version = self.world.planner._tuner._book.version
        message = {"op": "tune", "if_version": version, "changes": {"scale": 0.5}}
        self.world.requests["planner"].put(message, "page")

    def relent(self):
        self._goes_on = False

    def reacted(self):
        return self._failed > 0 and self.world.planner._tuner._book.tuning.scale == 0.5

    def bound(self):
        return SEND + self.world.period + self.world.thinking + 2 * TICK


SCENES = (F14, F15, F16, F21, F28, F30)
