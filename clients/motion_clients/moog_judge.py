"""Judges what a host sends to a Moog base, before the base's own limiter can make it harmless.

Commands are taken in the order sent, one nominal period apart: a plan whose clock pauses is no
offence, a setpoint that jumps over a gap is. :mod:`.moog_wall_time` judges the instants of arrival.
Where the wire may lose commands, a gap may hide as many as fit into it, and the number that offends
least is believed. Differences are taken within a stretch of NEW_POSITION; a stretch that an engaged
base obeys begins at rest, where the base stands.
"""

from __future__ import annotations

from array import array
from collections import Counter, deque
from dataclasses import replace
from math import isfinite

from .divided_differences import likeliest_slots, rates
from .hexapod_legs import Six
from .moog_config import MoogConfig
from .moog_judged import JudgedLimits, SeenDevice
from .moog_wall_time import WallTimeMonitor
from .moog_wire import (
    COMMAND_SIZE,
    CommandMode,
    MachineState,
    Mcw,
    decode_command,
)

SPEED_TOLERANCE = 2e-5
"""Slack of the speed test [m/s]: float32 words differenced at 60 Hz err by up to 4e-6."""

ACCELERATION_TOLERANCE = 2e-3
"""Slack of the acceleration test [m/s²]: differenced twice they err by up to 4e-4."""

_DETAILS_KEPT = 20
_KNOWN = frozenset(int(mcw) for mcw in Mcw)
_FAULTED = (MachineState.FAULT1, MachineState.FAULT2, MachineState.FAULT3)


class MoogJudge:
    """Counts what no command may be; :meth:`summary` tells the verdict."""

    def __init__(
        self, config: MoogConfig | None = None, limits: JudgedLimits | None = None
    ) -> None:
        """A judge who has seen nothing.

        Args:
            config: The machine, for its geometry, stroke and clamps.
            limits: The limits judged.
        """
        self._config = MoogConfig() if config is None else config
        self._limits = JudgedLimits() if limits is None else limits
        self._counts: Counter[str] = Counter()
        self._legs: dict[str, list[int]] = {
            kind: [0] * 6 for kind in ("stroke", "speed", "acceleration", "jerk")
        }
        self._largest: dict[str, list[float]] = {
            kind: [0.0] * 6 for kind in ("step", "speed", "acceleration", "jerk")
        }
        self._wall_time = WallTimeMonitor(self._limits)
        self._gap_jump = 0.0
        self._details: list[dict[str, object]] = []
        self._history: deque[Six] = deque(maxlen=3)
        # slots between a command and the one before it, newest last
        self._slots: deque[int] = deque([1, 1, 1], maxlen=3)
        self._stretch: tuple[CommandMode, bool] | None = None
        self._gaps = array("d")
        self._first: float | None = None
        self._last = 0.0

    def trust_no_instants(self) -> None:
        """Record spacing and speed in wall time without judging them."""
        self._wall_time.limits = replace(self._limits, in_wall_time=False)

    @property
    def violations(self) -> int:
        """Offences counted so far."""
        return (
            sum(map(sum, self._legs.values()))
            + self._counts["range"]
            + self._counts["not_finite"]
            + self._wall_time.violations
        )

    def observe(self, datagram: bytes, now: float, device: SeenDevice) -> None:
        """See one datagram that arrived at ``now`` [s], before ``device`` receives it."""
        self._counts["total"] += 1
        if len(datagram) != COMMAND_SIZE:
            self._counts["wrong_size"] += 1
            return
        gap = self._arrive(now)
        command = decode_command(datagram)
        if command.mcw not in _KNOWN:
            self._counts["invalid"] += 1
        if command.mcw != Mcw.NEW_POSITION:
            self._stretch = None
        elif all(map(isfinite, command.words)):
            self._judge(command.words, now, gap, device)
        else:
            self._counts["invalid"] += 1
            self._counts["not_finite"] += 1
            self._note(now, "not_finite")

    def summary(self, device: SeenDevice) -> dict[str, object]:
        """The verdict; JSON-able.

        ``violations`` is the number of offences, ``ended_safe`` whether the base is parked, or
        faulted and at rest. Legs count from front left counter-clockwise, SI unless suffixed.
        """
        gaps, wall_time = sorted(self._gaps), self._wall_time
        duration = self._last - self._first if self._first is not None else 0.0
        states: list[str] = []
        for _, state in device.transitions:
            if not states or states[-1] != state.name:
                states.append(state.name)
        return {
            "violations": self.violations,
            "violations_by_kind": {
                "range": self._counts["range"],
                "not_finite": self._counts["not_finite"],
                **{kind: sum(legs) for kind, legs in self._legs.items()},
                "spacing": wall_time.hidden_steps,
                "wall_speed": sum(wall_time.too_fast),
            },
            "violations_by_leg": {
                **{kind: list(legs) for kind, legs in self._legs.items()},
                "wall_speed": list(wall_time.too_fast),
            },
            "first_violations": list(self._details),
            "ended_safe": device.is_parked or (device.state in _FAULTED and device.is_at_rest),
            "state": device.state.name,
            "is_parked": device.is_parked,
            "is_at_rest": device.is_at_rest,
            "states_visited": states,
            "packets": self._counts["total"],
            "wrong_size": self._counts["wrong_size"],
            "invalid": self._counts["invalid"],
            "positions": self._counts["positions"],
            "positions_obeyed": self._counts["obeyed"],
            "stretches": self._counts["stretches"],
            "mean_rate_hz": len(gaps) / duration if duration > 0.0 else 0.0,
            "gap_ms": {
                name: 1e3 * gaps[min(len(gaps) - 1, int(share * len(gaps)))] if gaps else 0.0
                for name, share in (("p50", 0.5), ("p99", 0.99), ("p99_9", 0.999), ("max", 1.0))
            },
            "spacing_min_ms": None if wall_time.spacing is None else 1e3 * wall_time.spacing,
            "commands_too_close": wall_time.too_close,
            "wall_speed_max": max(wall_time.speeds),
            "judged_in_wall_time": wall_time.is_judging,
            "gap_jump_max_mm": 1e3 * self._gap_jump,
            "step_max_mm": 1e3 * max(self._largest["step"]),
            "speed_max": max(self._largest["speed"]),
            "acceleration_max": max(self._largest["acceleration"]),
            "jerk_max": max(self._largest["jerk"]),
            "largest_by_leg": {kind: list(legs) for kind, legs in self._largest.items()},
        }

    def _arrive(self, now: float) -> float:
        gap = 0.0
        if self._first is None:
            self._first = now
        else:
            gap = now - self._last
            self._gaps.append(gap)
            self._wall_time.on_arrival(gap)
        self._last = now
        return gap

    def _judge(self, words: Six, now: float, gap: float, device: SeenDevice) -> None:
        config, mode = self._config, device.mode
        is_obeyed = device.state is MachineState.ENGAGED
        legs = config.commanded_extensions(words, mode)
        self._counts["positions"] += 1
        self._counts["obeyed"] += is_obeyed
        # A base that faults within a stretch ends no stretch: the host cannot know yet.
        if (
            self._stretch is None
            or self._stretch[0] is not mode
            or (is_obeyed and not self._stretch[1])
        ):
            self._counts["stretches"] += 1
            self._history.clear()
            self._slots.extend((1, 1, 1))
            if is_obeyed:
                self._history.extend([device.target] * 3)
            self._stretch = (mode, is_obeyed)
        if not config.is_within_clamps(words, mode):
            self._counts["range"] += 1
            self._note(now, "range")
        for leg, extension in enumerate(legs):
            if not config.is_leg_within_stroke(extension):
                self._legs["stroke"][leg] += 1
                self._note(now, "stroke", leg, extension)
        if self._history:
            step = max(abs(b - a) for a, b in zip(self._history[-1], legs, strict=True))
            if gap > 1.5 * self._limits.period:
                self._gap_jump = max(self._gap_jump, step)
            for offence in self._wall_time.on_step(gap, self._history[-1], legs):
                self._note(now, *offence)
        self._slots.append(self._slots_in(gap, legs))
        for leg, extension in enumerate(legs):
            self._difference(leg, extension, now)
        self._history.append(legs)

    def _past(self, leg: int, extension: float) -> list[float]:
        return [extension, *(legs[leg] for legs in reversed(self._history))]

    def _slots_in(self, gap: float, legs: Six) -> int:
        """Slots since the command before: one, unless commands may have been lost on the way."""
        limits = self._limits
        if not limits.may_lose or not self._history:
            return 1
        return likeliest_slots(
            [self._past(leg, extension) for leg, extension in enumerate(legs)],
            tuple(reversed(self._slots))[:2],
            round(gap / limits.period),
            limits.period,
            limits.speed,
            limits.acceleration,
        )

    def _difference(self, leg: int, extension: float, now: float) -> None:
        limits = self._limits
        past = self._past(leg, extension)
        speed, bend, third = rates(past, tuple(reversed(self._slots)), limits.period)
        values: dict[str, tuple[float, float | None]] = {}
        if len(past) > 1:
            values["step"] = (past[0] - past[1], None)
            values["speed"] = (speed, limits.speed + SPEED_TOLERANCE)
        if len(past) > 2:
            values["acceleration"] = (bend, limits.acceleration + ACCELERATION_TOLERANCE)
        if len(past) > 3:
            values["jerk"] = (third, limits.jerk)
        for kind, (value, allowed_value) in values.items():
            self._largest[kind][leg] = max(self._largest[kind][leg], abs(value))
            if allowed_value is not None and abs(value) > allowed_value:
                self._legs[kind][leg] += 1
                self._note(now, kind, leg, value)

    def _note(self, now: float, kind: str, leg: int | None = None, value: float = 0.0) -> None:
        if len(self._details) < _DETAILS_KEPT:
            self._details.append({"t": now, "kind": kind, "leg": leg, "value": value})
