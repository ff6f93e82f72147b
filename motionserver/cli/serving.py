"""run, engage, park, reset, status, and what a configuration means."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import os
import socket
import sys
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np

from motionserver.cli.blackbox_text import box_status
from motionserver.cli.page_link import first_start_text
from motionserver.cli.running import (
    NotRunningError,
    Server,
    announced,
    find_server,
    server_of,
    silence,
)
from motionserver.core.kinematics.hexapod import leg_lengths
from motionserver.core.limits import machine_from_mapping
from motionserver.evaluate.bench.processes import free_port
from motionserver.settings.config import Config, load_config, run_dir_of
from motionserver.settings.machine import (
    MachineAsRead,
    box_as_toml,
    box_warning,
    describe_pose,
    read_machine,
)
from motionserver.settings.resolve import resolve
from motionserver.settings.usable import doubts
from motionserver.supervisor.addresses import try_way
from motionserver.supervisor.rundir import refuse_foreign
from motionserver.supervisor.service import Service
from motionserver.telemetry.link import Maps
from motionserver.telemetry.log_output import start_log
from motionserver.telemetry.requests import RequestError, ask
from motionserver.telemetry.signals import PARKING, ignore_signals
from motionserver.web.config import config_from


def serve(path: Path, dry_run: bool) -> int:
    """Run a server until a signal; returns its exit status."""
    ignore_signals(but=PARKING)
    config = load_config(path)
    start_log(config.server.log_level.upper())
    log = logging.getLogger("motionserver.supervisor")
    run_dir = run_dir_of(config)
    resolved = resolve(config, run_dir, dry_run)
    if config.web.enabled and resolved["web"]["port"] == 0:
        # chosen here, so that somebody is told which
        resolved["web"]["port"] = free_port(socket.SOCK_STREAM)
    service = make_service(config, resolved, run_dir)
    if config.web.enabled:
        sys.stdout.write(first_start_text(resolved["web"], sys.stdout) + "\n")
        sys.stdout.flush()
    read = read_machine(config.platform.preset)
    for warning in filter(None, (box_warning(read), *doubts(config, read.machine))):
        log.warning("%s", warning)
    if dry_run:
        log.info("dry run: everything is played, nothing that moves is sent")
    if config.operator.engage == "auto":
        log.warning("engage = auto: the platform RISES BY ITSELF when the first source is fresh")
    with contextlib.ExitStack() as stack:
        try:
            stack.enter_context(announced(server_of(config, str(path))))
        except OSError as error:
            log.warning(
                "commands without a configuration will not find this server: %s cannot be used "
                "to announce it (%s)", error.filename, error.strerror,
            )  # fmt: skip
        return asyncio.run(service.run())


def make_service(config: Config, resolved: dict[str, Any], run_dir: Path) -> Service:
    """The service of a configuration and of what `settings.resolve` made of it."""
    _check_page(config, resolved)
    local = (config.platform.local_host, config.platform.local_port)
    return Service(resolved, config.web.enabled, local, run_dir)


def _check_page(config: Config, resolved: dict[str, Any]) -> None:
    """Say here what the page would refuse at every start, while nothing moves yet."""
    if config.web.enabled:
        page = config_from(resolved["web"])
        page.check()
        page.check_certificate()


def describe(path: Path) -> str:
    """What a configuration means, for people."""
    config = load_config(path)
    resolved = resolve(config, run_dir_of(config))
    _check_page(config, resolved)
    refuse_foreign(run_dir_of(config))
    try_way(resolved["platform"]["host"], resolved["platform"]["port"])
    machine = machine_from_mapping(resolved["machine"])
    platform, planner = resolved["platform"], resolved["planner"]
    stroke = (machine.leg_max - machine.leg_min) * 1e3
    neutral = leg_lengths(machine, np.zeros(6))
    lines = [
        f"{path}: valid",
        f"platform   {platform['format']} ({config.platform.mode}) at {platform['host']}:"
        f"{platform['port']}, {platform['rate_hz']:g} packets/s",
        f"machine    {machine.name}, limits {machine.digest}: stroke {stroke:.1f} mm, "
        f"leg {machine.leg_speed:g} m/s, {machine.leg_acceleration:g} m/s2, "
        + ("jerk unchecked" if machine.leg_jerk is None else f"{machine.leg_jerk:g} m/s3"),
        f"neutral    legs {neutral.min():.4f} to {neutral.max():.4f} m; parked at "
        + describe_pose(machine.parked_pose),
        f"unchecked  {', '.join(resolved['unchecked']) or 'nothing'}",
        f"planner    {planner['tuning']['algorithm']}, scale {planner['tuning']['scale']:g}, "
        f"{1 / planner['period']:.1f} Hz, at first {planner['budget'] * 1e3:.1f} ms "
        "before the packet",
    ]
    lines += box_lines(read_machine(config.platform.preset))
    lines += wrapped([f"warning    {doubt}" for doubt in doubts(config, machine)])
    if planner["side_engines"]:
        lines.append(f"beside     {', '.join(planner['side_engines'])}")
    lines += [f"source     {s['kind']} on {s['host']}:{s['port']}" for s in resolved["sources"]]
    lines.append(f"engage     {config.operator.engage}")
    if config.web.enabled:
        lines.append(f"page       {config.web.host}:{config.web.port}")
    if config.platform.mode == "dof":
        lines.append("note       the base takes a pose: leg limits hold for the declared geometry")
    return "\n".join(lines)


def box_lines(read: MachineAsRead) -> list[str]:
    """What a description says of the box: that it was computed, or is out of proportion."""
    said = []
    if read.box_is_computed:
        toml = box_as_toml(read.machine.box)
        said.append(f"box        no [table2] in the file; computed: {toml}")
    if warning := box_warning(read):
        said.append(f"warning    {warning}")
    return wrapped(said)


def wrapped(lines: list[str]) -> list[str]:
    """Lines that fit a terminal; what is longer goes on below its first word."""
    return [part for line in lines for part in wrap(line, 80, subsequent_indent=" " * 11)]


def ask_guard(op: str, path: Path | None, run_dir: Path | None = None) -> dict[str, Any]:
    """Send an operator's edge over the guard's own socket."""
    server = find_server(op, path, run_dir)
    try:
        return ask(server.run_dir / "guard.sock", {"op": op, "by": "console"}, timeout=2.0)
    except RequestError as error:
        raise NotRunningError(f"{op}: {_unanswered(server, error)}") from error


def _unanswered(server: Server, error: RequestError) -> str:
    """Why a server that runs did not answer, and what to do."""
    owner = server.run_dir.stat().st_uid if server.run_dir.exists() else os.getuid()
    if owner != os.getuid():
        return f"{error}. {server.run_dir} belongs to another user: ask as that user"
    return (
        f"{error}. The server in {server.run_dir} is running, but its guard "
        f"{silence(server) or 'reports and does not answer'}; it may be starting, or the machine "
        "is overloaded: try again, see `motionserver status` and `motionserver doctor`"
    )


def status_text(path: Path | None, as_json: bool, run_dir: Path | None = None) -> str:
    """What a running server does, for people or as JSON."""
    server = find_server("status", path, run_dir)
    run_dir = server.run_dir
    try:
        maps = Maps(run_dir)
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise NotRunningError(
            f"status: the server in {run_dir} cannot be read ({why}); it may be starting or "
            "ending: try again"
        ) from error
    parts = {}
    for name, source in (
        ("guard", maps.guard),
        ("planner", maps.planner),
        ("processes", maps.service),
    ):
        message = source.read()
        parts[name] = None if message is None else json.loads(message[1])
    parts["blackbox"] = box = box_status(run_dir)
    guard, planner = parts["guard"], parts["planner"]
    if guard is not None and (problem := silence(server)) is not None:
        raise NotRunningError(f"status: no server runs in {run_dir}; {problem}")
    if as_json:
        return json.dumps(parts, indent=2)
    if guard is None:
        return "the guard has not shown anything yet"
    lines = [
        f"state      {guard['state']}: {guard['reason']}",
        f"pose       {describe_pose(np.array(guard['pose']))}",
        f"device     {guard['feedback']['device_state']}, faults: "
        + (", ".join(guard["feedback"]["faults"]) or "none"),
        f"packets    {guard['rates_hz']['send']:.2f} Hz, ticks late p99 "
        f"{guard['tick']['late_p99_ms']:.2f} ms",
    ]
    if planner is not None:
        source = planner["source"]
        lines.append(
            f"source     {source['kind']} {source['address']}, {source['rate_hz']:.0f} Hz, "
            f"{'fresh' if source['fresh'] else 'stale'}"
        )
        lines.append(
            f"plans      {planner['algorithm']}, p99 {planner['solver']['time_p99_ms']:.2f} ms"
        )
        side = planner["side"]
        lines += [_engine_line(engine) for engine in (side["driving"], *side["engines"])]
    if box is not None:
        failed = f", {box['failed']} not written: {box['error']}" if box["failed"] else ""
        lines.append(f"black box  {box['dumps']} dumps since the start{failed}")
    lines.append(f"server     {server}")
    return "\n".join(lines)


def _engine_line(engine: dict[str, Any]) -> str:
    """One engine in figures of the last half minute."""
    if engine.get("nrmse") is None:
        return f"engine     {engine['name']}: {engine.get('trouble') or 'nothing to judge yet'}"
    return (
        f"engine     {engine['name']}: force error {engine['nrmse']:.1%}, refused "
        f"{engine['kappa_refused'] or 0.0:.1%}, legs {engine['leg_use']:.0%}"
    )
