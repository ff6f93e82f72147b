"""What the guard shows: one JSON object, some thirty times a second."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping

import numpy as np

from motionserver.core.axes import Array
from motionserver.core.kinematics.hexapod import leg_speeds
from motionserver.core.safety.act import Guard
from motionserver.core.safety.setpoint import Setpoint
from motionserver.guard.options import GuardOptions


def _numbers(values: Array) -> list[float]:
    return [round(float(value), 6) for value in values]


def snapshot(
    guard: Guard,
    options: GuardOptions,
    setpoint: Setpoint,
    ticks: Mapping[str, object],
    rates: dict[str, float],
    now_ns: int,
) -> bytes:
    """Write the guard's snapshot.

    Args:
        guard: The guard.
        options: What it was told.
        setpoint: What was sent last.
        ticks: Figures of its ticks.
        rates: Measured rates, by name [Hz].
        now_ns: Now [ns].
    """
    record, machine = guard.record, guard.machine
    watch = guard.supervisor.device
    state = setpoint.state
    _, speeds = leg_speeds(machine, state.pose[None], state.velocity[None])
    playback = record.playback
    measured = watch.legs()
    newest = watch.newest
    return json.dumps(
        {
            "pid": os.getpid(),
            "t_ns": now_ns,
            "state": record.state,
            "reason": guard.reason,
            "since_ns": record.since_ns,
            "dry_run": options.guard.dry_run,
            "order": setpoint.order,
            "plan": None
            if playback is None
            else {
                "id": playback.playing.plan.plan_id,
                "time": round(playback.clock, 4),
                "duration": round(playback.playing.plan.duration, 4),
                "remaining": round(playback.remaining, 4),
                "way_home": round(playback.newest.way_home, 3),
            },
            "pose": _numbers(state.pose),
            "velocity": _numbers(state.velocity),
            "acceleration": _numbers(state.acceleration),
            "legs": _numbers(setpoint.legs),
            "leg_speed": _numbers(speeds[0]),
            "feedback": {
                "age_s": None if newest is None else round(watch.age(now_ns), 4),
                "legs": None if measured is None else _numbers(measured),
                "device_state": None if newest is None else newest.state,
                "phase": None if newest is None else newest.phase,
                "faults": [] if newest is None else list(newest.faults),
            },
            "tracking_error": round(watch.error, 6),
            "limits": {
                "machine": machine.name,
                "digest": machine.digest,
                "leg_min": machine.leg_min,
                "leg_max": machine.leg_max,
                "leg_speed": machine.leg_speed,
                "leg_acceleration": machine.leg_acceleration,
                "leg_jerk": machine.leg_jerk,
                "unchecked": list(options.unchecked),
            },
            "source": {
                "fresh": guard.supervisor.source.is_fresh(now_ns),
                "paused": guard.supervisor.source.is_paused,
            },
            "counters": dict(record.counters),
            "rates_hz": rates,
            "tick": ticks,
            "rejections": [
                {
                    "t_ns": when,
                    "reason": what.reason,
                    "when": what.when,
                    "leg": what.leg,
                    "value": _finite(what.value),
                    "allowed": _finite(what.allowed),
                }
                for when, what in list(record.rejections)[-10:]
            ],
            "events": [{"t_ns": when, "text": text} for when, text in list(record.events)[-20:]],
        }
    ).encode()


def _finite(value: float | None) -> float | None:
    return None if value is None or not np.isfinite(value) else round(float(value), 9)
