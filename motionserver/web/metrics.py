"""The status as Prometheus text, from a registry of its own."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily
from prometheus_client.metrics_core import Metric
from prometheus_client.registry import Collector

from motionserver.core.axes import AXIS_NAMES
from motionserver.web.audit import Audit
from motionserver.web.snapshot import StatusBoard

_STATES: Final = ("OFFLINE", "PARKED", "RAISING", "READY", "RUN", "HOLD", "PARKING", "FAULT",
                  "SAFE", "UNKNOWN")  # fmt: skip
_LEGS: Final = tuple(str(number) for number in range(1, 7))
_SINGLES: Final = (
    ("guard", ("feedback", "age_s"), "feedback_age_seconds", "Age of the platform's feedback."),
    ("guard", ("tracking_error",), "tracking_error_metres", "Legs commanded minus measured."),
    ("guard", ("plan", "kappa"), "plan_kappa", "Share of the candidate in the plan played."),
    ("planner", ("source", "age_s"), "input_age_seconds", "Age of the newest cue."),
    ("planner", ("tuning", "version"), "tuning_version", "Version of the tuning in force."),
    (
        "planner",
        ("handover", "lead_slots"),
        "handover_lead_slots",
        "Send slots added because plans came too late.",
    ),
    ("planner", ("handover", "waiting"), "plans_waiting", "Accepted plans that wait to be played."),
    (
        "planner",
        ("handover", "ahead_ms"),
        "plan_ahead_milliseconds",
        "How long before its send slot a plan is begun.",
    ),
    ("planner", ("solver", "iterations"), "solver_iterations", "Iterations of the last step."),
)
_ENGINE: Final = (
    ("nrmse", "nrmse", "Error of the felt force over the wanted one, last half minute."),
    ("kappa_refused", "refused_share", "Share of periods in which nothing passed."),
    ("think_p99_ms", "think_p99_milliseconds", "Time to think."),
    ("skipped", "skipped_periods", "Periods without time to think."),
)


class StatusCollector(Collector):
    """Turns the shared status into metrics when it is scraped.

    Args:
        board: The status.
        answered: HTTP answers by status code.
        audit: The log of who changed what, for what it could not write.
    """

    def __init__(self, board: StatusBoard, answered: Counter[str], audit: Audit) -> None:
        self._board = board
        self._answered = answered
        self._audit = audit

    def collect(self) -> Iterator[Metric]:
        """All metrics of now; what a process did not say is left out."""
        data = self._board.current().data
        guard, planner = data["guard"] or {}, data["planner"] or {}
        state = str(data["state"])
        yield _gauge("state", "1 for the motion state in force.", "state",
                     {s: float(s == state) for s in _STATES})  # fmt: skip
        alive = {name: float(p["alive"]) for name, p in data["processes"].items()}
        yield _gauge("process_alive", "1 while the process reports.", "process", alive)
        yield from self._counters(guard, planner)
        for name, snapshot in (("guard", guard), ("planner", planner)):
            rates = _numbers(snapshot.get("rates_hz"))
            yield _gauge(f"{name}_rate_hertz", f"Rates of the {name}.", "loop", rates)
        yield from _lists(guard, planner)
        yield from _quantiles(guard, planner)
        yield from _engines(planner.get("side"))
        for process, path, name, text in _SINGLES:
            value = _at(guard if process == "guard" else planner, path)
            if value is not None:
                yield GaugeMetricFamily(f"motionserver_{name}", text, value)

    def _counters(self, guard: Mapping[str, Any], planner: Mapping[str, Any]) -> Iterator[Metric]:
        events = CounterMetricFamily(
            "motionserver_events", "What was counted.", labels=["process", "name"]
        )
        for process, snapshot in (("guard", guard), ("planner", planner)):
            for name, count in _numbers(snapshot.get("counters")).items():
                events.add_metric([process, name], count)
        yield events
        http = CounterMetricFamily("motionserver_http_answers", "HTTP answers.", labels=["status"])
        for status, count in sorted(self._answered.items()):
            http.add_metric([status], count)
        yield http
        yield CounterMetricFamily(
            "motionserver_audit_lost", "Lines that the audit log's disk refused.", self._audit.lost
        )


def registry_for(board: StatusBoard, answered: Counter[str], audit: Audit) -> CollectorRegistry:
    """A registry that holds nothing but the status and what the page itself counts."""
    registry = CollectorRegistry()
    registry.register(StatusCollector(board, answered, audit))
    return registry


def text_of(registry: CollectorRegistry) -> bytes:
    """The registry in Prometheus' text format."""
    return generate_latest(registry)


def _lists(guard: Mapping[str, Any], planner: Mapping[str, Any]) -> Iterator[Metric]:
    legs = zip(_LEGS, _list(guard.get("legs")), strict=False)
    yield _gauge("leg_length_metres", "Leg lengths, pin to pin.", "leg", dict(legs))
    speeds = zip(_LEGS, _list(guard.get("leg_speed")), strict=False)
    yield _gauge("leg_speed_metres_per_second", "Leg speeds.", "leg", dict(speeds))
    limits = planner.get("x_max")
    bounded = {
        axis: value
        for axis, value in zip(AXIS_NAMES, limits if isinstance(limits, list) else (), strict=False)
        if isinstance(value, (int, float))
    }
    yield _gauge("position_limit", "X_max on axes that have one [m, rad].", "axis", bounded)


def _quantiles(guard: Mapping[str, Any], planner: Mapping[str, Any]) -> Iterator[Metric]:
    tick = _numbers(guard.get("tick"))
    late = {q: tick[k] / 1e3 for q, k in (("0.5", "late_p50_ms"), ("0.99", "late_p99_ms"),
                                         ("1", "late_max_ms")) if k in tick}  # fmt: skip
    yield _gauge("tick_late_seconds", "Lateness of the guard's tick.", "quantile", late)
    solver = _numbers(planner.get("solver"))
    took = {q: solver[k] / 1e3 for q, k in (("0.5", "time_p50_ms"), ("0.99", "time_p99_ms"))
            if k in solver}  # fmt: skip
    yield _gauge("solver_time_seconds", "Time of one planning step.", "quantile", took)


def _engines(side: object) -> Iterator[Metric]:
    """Figures of the driving engine and of those beside it, by the name of the algorithm."""
    found = side if isinstance(side, dict) else {}
    engines = [found.get("driving"), *(found.get("engines") or ())]
    named = {str(e["name"]): e for e in engines if isinstance(e, dict) and "name" in e}
    for key, name, text in _ENGINE:
        values = {engine: _at(figures, (key,)) for engine, figures in named.items()}
        yield _gauge(f"engine_{name}", text, "engine",
                     {e: v for e, v in values.items() if v is not None})  # fmt: skip


def _gauge(name: str, text: str, label: str, values: Mapping[str, float]) -> Metric:
    family = GaugeMetricFamily(f"motionserver_{name}", text, labels=[label])
    for key, value in values.items():
        family.add_metric([key], value)
    return family


def _numbers(data: object) -> dict[str, float]:
    items = data.items() if isinstance(data, dict) else ()
    return {str(k): float(v) for k, v in items if isinstance(v, (int, float))}


def _list(data: object) -> Sequence[float]:
    fits = isinstance(data, list) and all(isinstance(v, (int, float)) for v in data)
    return data if fits and isinstance(data, list) else ()


def _at(data: Mapping[str, Any], path: tuple[str, ...]) -> float | None:
    value: Any = data
    for key in path:
        value = value.get(key) if isinstance(value, dict) else None
    return float(value) if isinstance(value, (int, float)) else None
