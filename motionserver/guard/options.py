"""What the supervisor tells the guard, as plain JSON, already in SI and validated."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from motionserver.core.limits import machine_from_mapping
from motionserver.core.safety.given import GuardConfig
from motionserver.platforms.base import PlatformOptions
from motionserver.telemetry.run_files import read_run_file


@dataclass(frozen=True, slots=True)
class GuardOptions:
    """Everything the guard process needs.

    Attributes:
        guard: The guard's own configuration.
        format: Name of the packet format.
        options: How this machine differs.
        peer: Address of the platform.
        rate_hz: Packets per second [Hz].
        unchecked: Names of limits that the machine's file does not state.
        enable_input: File that reads 1 while engaging by the page is allowed; None = no input.
        realtime: True: ask for real-time scheduling.
    """

    guard: GuardConfig
    format: str
    options: PlatformOptions
    peer: tuple[str, int]
    rate_hz: float
    unchecked: tuple[str, ...]
    enable_input: Path | None
    realtime: bool


def read_options(run_dir: Path) -> GuardOptions:
    """Read ``config.json`` of a run."""
    data: dict[str, Any] = json.loads(read_run_file(run_dir, "config.json"))
    platform = data["platform"]
    options = dict(platform["options"])
    options["leg_order"] = tuple(options["leg_order"])
    return GuardOptions(
        guard=GuardConfig(
            machine=machine_from_mapping(data["machine"]),
            send_period=1.0 / platform["rate_hz"],
            plan_period=data["planner"]["period"],
            engage=data["engage"],
            dry_run=data["dry_run"],
        ),
        format=platform["format"],
        options=PlatformOptions(**options),
        peer=(platform["host"], platform["port"]),
        rate_hz=platform["rate_hz"],
        unchecked=tuple(data["unchecked"]),
        enable_input=Path(data["enable_input"]) if data["enable_input"] else None,
        realtime=data["realtime"],
    )
