"""What guard and planner last said, put together at most once per 50 ms for all readers."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Protocol

from motionserver.web.config import WebConfig
from motionserver.web.refusal import to_json

PERIOD: Final = 0.05
"""Least time between two statuses [s]."""
_ALIVE: Final = 1.0
"""Age of a snapshot up to which its process counts as alive [s]."""


class SnapshotSource(Protocol):
    """Where the newest snapshot of a process is read."""

    def read(self) -> dict[str, Any] | None:
        """The newest snapshot, or None if there never was one."""
        ...


@dataclass(frozen=True, slots=True)
class Status:
    """One status, shared by all readers.

    Attributes:
        data: As a mapping.
        text: As JSON.
        made_ns: When it was made, CLOCK_MONOTONIC [ns].
    """

    data: Mapping[str, Any]
    text: bytes
    made_ns: int


class StatusBoard:
    """Computes the status when asked, and keeps it for 50 ms.

    Args:
        guard: Snapshots of the guard.
        planner: Snapshots of the planner.
        service: Who was started, from the service that watches the others.
        config: For the machine and the policy of engaging.
        now_ns: Clock, CLOCK_MONOTONIC [ns].
    """

    def __init__(
        self,
        guard: SnapshotSource,
        planner: SnapshotSource,
        service: SnapshotSource,
        config: WebConfig,
        now_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self._guard = guard
        self._planner = planner
        self._service = service
        self._config = config
        self._now_ns = now_ns
        self._last: Status | None = None

    def current(self) -> Status:
        """The status of now, at most 50 ms old."""
        now = self._now_ns()
        if self._last is None or now - self._last.made_ns >= PERIOD * 1e9:
            data = self._compute(now)
            self._last = Status(data, to_json(data), now)
        return self._last

    def _compute(self, now: int) -> dict[str, Any]:
        guard, planner = _read(self._guard), _read(self._planner)
        service = _read(self._service)
        processes = _processes(guard, planner, service, now)
        alive = processes["guard"]["alive"]
        refusal = self._config.engage_refusal()
        return {
            "t_ns": now,
            "state": guard.get("state", "UNKNOWN") if alive else "UNKNOWN",
            "reason": guard.get("reason", "") if alive else _silence("guard", processes["guard"]),
            "algorithm": planner.get("algorithm"),
            "x_max": planner.get("x_max"),
            "processes": processes,
            "counters": _merged(planner, guard, "counters"),
            "rates_hz": _merged(planner, guard, "rates_hz"),
            "engage": {"by_http": refusal is None, "why_not": refusal},
            "machine": {
                name: self._config.machine.get(name)
                for name in ("name", "base_joints", "platform_joints", "neutral_height", "head",
                             "box", "parked_pose")
            },
            "guard": guard or None,
            "planner": planner or None,
        }  # fmt: skip


def _read(source: SnapshotSource) -> dict[str, Any]:
    """The newest snapshot; an unreadable one is as good as none."""
    try:
        return source.read() or {}
    except (OSError, ValueError):
        return {}


def _processes(
    guard: Mapping[str, Any], planner: Mapping[str, Any], service: Mapping[str, Any], now: int
) -> dict[str, dict[str, Any]]:
    """Who lives, by its own word; and the spare guard, by the service's."""
    found = {
        "guard": _process(guard, now),
        "planner": _process(planner, now),
        "web": {"pid": os.getpid(), "alive": True, "age_s": 0.0},
    }
    watching = _process(service, now)
    if service:
        is_there = watching["alive"] and service.get("spare") is not None
        found["spare"] = {"pid": service.get("spare"), "alive": is_there, "age_s": None}
        found["service"] = watching
    restarts = service.get("restarts") or {}
    for name, process in found.items():
        process["restarts"] = restarts.get(name)
    return found


def _process(snapshot: Mapping[str, Any], now: int) -> dict[str, Any]:
    stamp = snapshot.get("t_ns")
    age = (now - stamp) / 1e9 if isinstance(stamp, int) else None
    return {"pid": snapshot.get("pid"), "alive": age is not None and age < _ALIVE, "age_s": age}


def _silence(name: str, process: Mapping[str, Any]) -> str:
    age = process["age_s"]
    return f"the {name} has not reported " + ("yet" if age is None else f"for {age:.1f} s")


def _merged(planner: Mapping[str, Any], guard: Mapping[str, Any], key: str) -> dict[str, Any]:
    """Both processes' numbers under one roof; where both name one, the guard's."""
    return {**(planner.get(key) or {}), **(guard.get(key) or {})}
