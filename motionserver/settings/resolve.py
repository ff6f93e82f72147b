"""From the configuration to what each process is told: plain JSON, SI, validated once."""

from __future__ import annotations

from dataclasses import asdict
from math import ceil
from pathlib import Path
from typing import Any

from motionserver.bounded_files import SETTINGS_BYTES, FileNotUsableError, check_regular
from motionserver.core.axes import frozen
from motionserver.core.limits import Machine, machine_to_mapping
from motionserver.cueing.registry import algorithms
from motionserver.errors import ConfigError
from motionserver.platforms.base import PlatformOptions
from motionserver.platforms.registry import make_platform
from motionserver.settings.address_rules import ip_of
from motionserver.settings.config import Config, SourceSection, split_address, state_dir_of
from motionserver.settings.fields import TuningError
from motionserver.settings.key_file import read_key
from motionserver.settings.machine import load_machine, unchecked_limits
from motionserver.settings.side_engines import side_names
from motionserver.settings.tuning import BOX_FIELDS, apply_changes, default_for
from motionserver.settings.tuning_proof import make_with
from motionserver.settings.tuning_scope import check_effect
from motionserver.settings.usable import check_usable


def resolve(config: Config, run_dir: Path, dry_run: bool = False) -> dict[str, Any]:
    """Check everything that can be checked without a socket.

    Args:
        config: The configuration.
        run_dir: Where the processes meet.
        dry_run: True: send nothing that moves.

    Returns:
        The content of ``config.json``; the part under "web" is the page's own file.

    Raises:
        ConfigError: Something contradicts something, or a named thing does not exist.
    """
    platform, cueing = config.platform, config.cueing
    machine = load_machine(platform.preset)
    if platform.head_m is not None:
        machine = machine.with_head(frozen(platform.head_m))
    check_usable(config, machine, run_dir)
    offset = platform.length_offset_m
    options = PlatformOptions(
        mode=platform.mode,
        length_offset=machine.leg_min if offset is None else offset,
        leg_order=platform.leg_order,
        heave_neutral=platform.heave_neutral_m,
        engage_word=platform.engage_word,
    )
    make_platform(platform.format, options)
    if cueing.algorithm not in algorithms():
        raise ConfigError(
            "[cueing] algorithm",
            f"unknown {cueing.algorithm!r}",
            f"Allowed: {', '.join(algorithms())}.",
        )
    tuning = {**cueing.tuning, "algorithm": cueing.algorithm, "scale": cueing.scale}
    per_plan = ceil(platform.rate_hz / cueing.rate_max_hz)
    period = per_plan / platform.rate_hz
    try:
        side = side_names(config.planner.side_engines)
    except TuningError as error:
        raise ConfigError(
            "[planner] side_engines",
            "; ".join(f"{e.value}: {e.message}" for e in error.errors),
            f"Allowed: {error.errors[0].allowed}.",
        ) from error
    _check_tuning(machine, period, tuning, side)
    return {
        "machine": machine_to_mapping(machine),
        "unchecked": unchecked_limits(machine),
        "engage": config.operator.engage,
        "dry_run": dry_run,
        "enable_input": _whole(config.operator.enable_input),
        "realtime": config.server.realtime,
        "blackbox": {
            "folder": str(state_dir_of(config) / "blackbox"),
            "kept": config.server.blackbox_kept,
        },
        "platform": {
            "format": platform.format,
            "options": asdict(options),
            "host": str(ip_of(platform.host)),
            "port": platform.port,
            "rate_hz": platform.rate_hz,
        },
        "planner": {
            "period": period,
            "budget": min(cueing.budget_ms * 1e-3, 0.8 * period),
            "arm": list(cueing.vehicle_head_m),
            "tuning": tuning,
            "side_engines": list(side),
            "sessions_file": str(
                state_dir_of(config) / f"sessions-{config.platform.local_port}.bin"
            ),
        },
        "sources": [_source(one) for one in config.sources],
        "web": _web(config, run_dir, machine_to_mapping(machine)),
    }


def _check_tuning(
    machine: Machine, period: float, tuning: dict[str, Any], side: tuple[str, ...]
) -> None:
    """Make every algorithm that shall run, so that none is found missing by the planner.

    Raises:
        ConfigError: A tunable is wrong, is read by none of them, or cannot be used here.
    """
    where = "[cueing.tuning]"
    try:
        default = default_for(machine)
        model = apply_changes(default, tuning)
        model.check_machine(machine)
        # the box is read by `motionserver workspace` whatever drives
        acting = {name: value for name, value in tuning.items() if name not in BOX_FIELDS}
        check_effect(acting, (model.algorithm, *side), default.values())
        make_with(machine, period, model, default)
    except TuningError as error:
        first = error.errors[0]
        key = "[cueing] algorithm" if first.field == "algorithm" else where
        raise ConfigError(key, str(error), "Correct this value, or leave it out.") from error
    for name in side:
        try:
            make_with(machine, period, apply_changes(model, {"algorithm": name}), model)
        except TuningError as error:
            raise ConfigError(
                f"[planner] side_engines: {name}", str(error), "Leave it out, or correct this."
            ) from error


def _source(source: SourceSection) -> dict[str, Any]:
    where = f"[[sources]] {source.kind} {source.listen}"
    host, port = split_address(source.listen)
    key = b""
    if source.key_file:
        if source.kind == "beamng":
            raise ConfigError(
                f"{where}: key_file",
                "the game's packets carry no signature, so that the key would keep nobody out",
                "Remove it; beyond 127.0.0.1 the game's packets need allow_unsigned = true and a "
                "network that nobody else can reach.",
            )
        key = read_key(Path(source.key_file).expanduser(), f"{where}: key_file")
    if not _is_loopback(host) and not key and not source.allow_unsigned:
        raise ConfigError(
            f"{where}: listen",
            "other computers could move the platform with unsigned packets",
            "Give key_file, listen on 127.0.0.1, or say allow_unsigned = true on a network that "
            "nobody else can reach.",
        )
    secure = str(Path(source.zenoh_config).expanduser()) if source.zenoh_config else ""
    if secure:
        try:
            check_regular(secure, SETTINGS_BYTES)
        except OSError as error:
            why = error.strerror if isinstance(error, FileNotUsableError) else "no such file"
            raise ConfigError(
                f"{where}: zenoh_config", f"{secure}: {why}", "Give Zenoh's configuration."
            ) from error
    return {
        "kind": source.kind,
        "host": host,
        "port": port,
        "key": key.hex(),
        "topic": source.topic,
        "connect": source.connect,
        "preview_topic": source.preview_topic,
        "zenoh_config": secure,
    }


def _whole(path: str) -> str:
    """A path with the home folder for ~; "" stays that."""
    return str(Path(path).expanduser()) if path else ""


def _is_loopback(host: str) -> bool:
    ip = ip_of(host)
    return ip is not None and ip.is_loopback


def _web(config: Config, run_dir: Path, machine: dict[str, object]) -> dict[str, Any]:
    web, state_dir = config.web, state_dir_of(config)
    return {
        "host": web.host,
        "port": web.port,
        "tokens_file": _whole(web.tokens_file) or str(state_dir / "tokens.json"),
        "run_dir": str(run_dir),
        "audit_file": str(state_dir / "audit.jsonl"),
        "presets_dir": str(state_dir / "presets"),
        "blackbox_dir": str(state_dir / "blackbox"),
        "machine": machine,
        "allowed_hosts": web.allowed_hosts,
        "engage": "http" if config.operator.engage == "http" else "local",
        "enable_input": bool(config.operator.enable_input),
        "tls_cert": _whole(web.tls_cert) or None,
        "tls_key": _whole(web.tls_key) or None,
    }
