"""What the supervisor tells the planner, as plain JSON, already in SI and validated."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from motionserver.core.axes import Array, frozen
from motionserver.core.limits import Machine, machine_from_mapping
from motionserver.telemetry.run_files import read_run_file


@dataclass(frozen=True, slots=True)
class InputOptions:
    """One of ``[[sources]]``.

    Attributes:
        kind: Name of the format.
        host: Address to listen on.
        port: Port to listen on.
        key: Key of signed packets, if any.
        topic: Zenoh key, for kind zenoh.
        connect: Zenoh endpoints to connect to, for kind zenoh.
        preview_topic: Zenoh key of previews that come apart from the cues; "" for none.
        zenoh_config: Zenoh's own file with certificates, passwords and access list; "" for none.
    """

    kind: str
    host: str
    port: int
    key: bytes | None
    topic: str
    connect: tuple[str, ...]
    preview_topic: str = ""
    zenoh_config: str = ""


@dataclass(frozen=True, slots=True)
class PlannerOptions:
    """Everything the planner process needs.

    Attributes:
        machine: Geometry and hard limits.
        period: Planner period [s].
        send_period: Period of the platform's packets [s].
        budget: How long before a send slot it wakes until it has measured its plans [s].
        arm: Driver's head from the point whose motion is sent, (3,) [m].
        inputs: The sources.
        tuning: Tunables at the start, in the units of the page.
        tuning_file: Where the tuning in force survives a restart of the planner.
        sessions_file: Where signed sessions are remembered over a restart of the server.
        realtime: True: ask for real-time scheduling.
        side_engines: Algorithms that run beside the driving one at the start.
    """

    machine: Machine
    period: float
    send_period: float
    budget: float
    arm: Array
    inputs: tuple[InputOptions, ...]
    tuning: dict[str, Any]
    tuning_file: Path
    sessions_file: Path
    realtime: bool
    side_engines: tuple[str, ...] = ()


def read_options(run_dir: Path) -> PlannerOptions:
    """Read ``config.json`` of a run."""
    data: dict[str, Any] = json.loads(read_run_file(run_dir, "config.json"))
    planner = data["planner"]
    inputs = tuple(
        InputOptions(
            kind=source["kind"],
            host=source["host"],
            port=source["port"],
            key=bytes.fromhex(source["key"]) or None,
            topic=source["topic"],
            connect=tuple(source["connect"]),
            preview_topic=source.get("preview_topic", ""),
            zenoh_config=source.get("zenoh_config", ""),
        )
        for source in data["sources"]
    )
    return PlannerOptions(
        machine=machine_from_mapping(data["machine"]),
        period=planner["period"],
        send_period=1.0 / data["platform"]["rate_hz"],
        budget=planner["budget"],
        arm=frozen(planner["arm"]),
        inputs=inputs,
        tuning=planner["tuning"],
        tuning_file=run_dir / "tuning.json",
        sessions_file=Path(planner["sessions_file"]),
        realtime=data["realtime"],
        side_engines=tuple(planner["side_engines"]),
    )
