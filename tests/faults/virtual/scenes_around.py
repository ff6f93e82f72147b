"""Faults around the moving processes, of which the platform notices nothing: F18, F26, F27,
F29; and F33, resources that end."""

import errno
import tomllib
from pathlib import Path

import pytest
import stated
from scenario import TICK, Fault, stale

from motionserver.errors import ConfigError
from motionserver.settings.machine import parse_machine


class Unseen(Fault):
    """Nothing may happen: byte for byte what is sent in the same scene without the fault."""

    stays = True
    is_unseen = True

    def reacted(self):
        return True

    def bound(self):
        return TICK


class F18(Unseen):
    number = 18
    title = "the wall clock jumps"
    detection = "none: CLOCK_MONOTONIC only"
    reaction = "none"
    recovery = "none needed"

    def strike(self):
        jumped = self.rng.choice((-1e9, -3600.0, 7200.0, 1e9))
        self.world.patch.setattr("time.time", lambda: 1.8e9 + jumped)
        self.world.patch.setattr("time.time_ns", lambda: int((1.8e9 + jumped) * 1e9))


class F26(Unseen):
    number = 26
    title = "the page crashes or hangs"
    detection = stated.NO_SIGN
    reaction = "none; the service starts another"
    recovery = "none needed"

    def strike(self):
        """It dies in the middle of a request, and reads no snapshot any more."""
        self.world.requests["guard"].put(None)
        self.world.requests["planner"].put({"no": "op"})


class F27(Unseen):
    number = 27
    title = "flood of requests, and what it lets through"
    detection = stated.REQUESTS_READ
    reaction = "none; every request answered or dropped"
    recovery = "none needed"

    def strike(self):
        self._goes_on = True
        self._flood()

    def _flood(self):
        if not self._goes_on:
            return
        for _ in range(30):
            message = self.rng.choice(
                ({"op": "engage", "by": "http"}, {"op": "reset", "by": "http"}, {"op": "dance"}, [])
            )
            self.world.requests["guard"].put(message, "page")
            self.world.requests["planner"].put({"op": "tuning"}, "page")
        self.world.after(0.001, self._flood)

    def relent(self):
        self._goes_on = False

    def check(self):
        dropped = self.world.requests["guard"].dropped
        return [] if dropped else ["F27: the flood was none"]


class F29(Unseen):
    number = 29
    title = "bad configuration at the start or while it runs"
    detection = "the whole file is validated before use"
    reaction = "refused with line and reason; what runs does not read it"
    recovery = "none needed"

    def strike(self):
        folder = Path(parse_machine.__globals__["__file__"]).parent.parent / "presets" / "platforms"
        text = (folder / "t2-compact.toml").read_text("utf-8")
        keys = [key for key in tomllib.loads(text) if f"\n{key} = " in f"\n{text}"]
        spoilt = (
            text[: self.rng.randrange(len(text) // 2)],
            text.replace(f"{keys[-1]} = ", f"{keys[-1]}s = "),
            text + "\n[nonsense]\n",
            text.replace("0.9022", "nan"),
        )
        for wrong in spoilt:
            with pytest.raises(ConfigError):
                parse_machine(wrong, Path("machine.toml"))


class F33(Fault):
    number = 33
    title = "no descriptors, no memory left"
    detection = "what the system call raises"
    reaction = "the guard counts and goes on; a planner that hears nothing: as F1"
    recovery = "automatic"
    may_fail_ticks = True

    def __init__(self, world, rng):
        super().__init__(world, rng)
        self.kind = rng.choice(("memory", "descriptors", "send"))
        self.seconds = 0.07 if self.kind == "send" else rng.uniform(0.3, 1.3)
        self.stays = self.kind == "send"
        self.returns = True

    def strike(self):
        self._sent_ns = self.world.client.sent_ns
        if self.kind == "send":
            self.world.refuses_to_send = OSError(errno.ENOBUFS, "no buffer space available")
        elif self.kind == "memory":
            self.world.way.broken = MemoryError()
        else:
            self.world.way.broken = OSError(errno.EMFILE, "too many open files")

    def relent(self):
        self.world.way.broken = None
        self.world.plug_base()

    def onset_ns(self):
        return self._sent_ns

    def reacted(self):
        return self.world.counters["send_errors"] > 0 if self.stays else self.has_left_run

    def bound(self):
        return stale(self.world) + self.world.period + self.world.thinking + 2 * TICK


SCENES = (F18, F26, F27, F29, F33)
