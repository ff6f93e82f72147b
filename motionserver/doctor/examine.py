"""The whole examination: reads, tries and measures, and gathers the findings."""

from __future__ import annotations

import ipaddress
import os
from pathlib import Path
from typing import Any, Final

from motionserver.doctor import (
    addresses,
    clocks,
    folders,
    kernel,
    keyfiles,
    measure,
    processors,
    scheduling,
    software,
    timing,
    way,
)
from motionserver.doctor.finding import Finding, Level, unknown
from motionserver.doctor.report import Report
from motionserver.doctor.tree import Tree
from motionserver.errors import ConfigError
from motionserver.evaluate.bench.processes import BenchError
from motionserver.settings.config import Config, run_dir_of, split_address, state_dir_of
from motionserver.settings.resolve import resolve

NOT_MEASURED: Final = "the guard's rate was not measured: nothing can be promised"


def examine(config: Config, path: Path | None, seconds: float, tree: Tree) -> Report:
    """Look at everything.

    Args:
        config: The configuration, or the defaults.
        path: Its file; None looks at the machine only, not at ports, files and the platform.
        seconds: How long the sleeping process is watched [s].
        tree: The machine's files.
    """
    realtime, packets_hz = config.server.realtime, config.platform.rate_hz
    rate_hz = timing.tick_rate_of(packets_hz)
    before = processors.stolen(tree)
    sleep: timing.Sleep | None
    try:
        sleep, complaint = measure.sleep_beside(rate_hz, seconds, realtime), ""
    except (BenchError, OSError) as error:
        sleep, complaint = None, str(error)
    after = processors.stolen(tree)
    if sleep is None:
        findings = [unknown("wake-up lateness", complaint), unknown("stalls", complaint)]
    else:
        findings = [timing.wake_up_lateness(sleep), timing.stalls(sleep, packets_hz)]
    granted = None if sleep is None else sleep.scheduling
    findings += [
        timing.timer_grain(measure.timer_resolution()),
        scheduling.scheduling_class(tree, granted, realtime),
        processors.steal_time(before, after),
        *machine_findings(tree),
        clocks.clock_of_day(measure.clock_of_day()),
        *software_findings(config),
        folders.run_directory(folders.look_at(tree, run_dir_of(config))),
        folders.state_directory(folders.look_at(tree, state_dir_of(config))),
    ]
    if path is not None:
        findings += configuration_findings(config, path, tree)
    return Report(
        NOT_MEASURED if sleep is None else timing.promise(sleep),
        tuple(findings),
        None if sleep is None else sleep.to_mapping(),
        None if path is None else str(path),
    )


def machine_findings(tree: Tree) -> list[Finding]:
    """All that is read from the machine's files alone."""
    return [
        scheduling.realtime_throttle(tree),
        scheduling.memory_lock(tree),
        processors.governor(tree),
        processors.processors(tree),
        processors.quota(tree),
        kernel.huge_pages(tree),
        kernel.clock_source(tree),
        kernel.swap(tree),
        kernel.kernel_log(tree),
        kernel.open_files(tree),
        addresses.receive_buffer(tree),
    ]


def software_findings(config: Config) -> list[Finding]:
    """What is installed, and what the environment says."""
    there = software.installed()
    wanted = config.cueing.tuning.get("backend")
    return [
        software.python(there),
        software.libraries(there),
        software.optional_backends(there, wanted if isinstance(wanted, str) else None),
        software.blas_threads(os.environ),
    ]


def configuration_findings(config: Config, path: Path, tree: Tree) -> list[Finding]:
    """What only a configuration can be asked for: addresses, files, the platform."""
    platform, web = config.platform, config.web
    out = [configuration(config, path)]
    tried = addresses.try_addresses(tree, wanted_addresses(config))
    # the platform's comes first: whoever of ours has it is the server of this configuration
    holder = tried[0].holder
    runs = holder is not None and holder.is_ours
    out += [addresses.own_address(one, runs) for one in tried]
    host = "127.0.0.1" if platform.host == "localhost" else platform.host
    try:
        ipaddress.ip_address(host)
    except ValueError:
        out.append(unknown("way to the platform", f"{host} is no IP address"))
    else:
        found = way.find_way(host, platform.local_host, platform.port)
        out.append(way.platform_way(tree, found))
    if web.enabled:
        tokens = Path(web.tokens_file or state_dir_of(config) / "tokens.json")
        out.append(keyfiles.token_file(keyfiles.look_at_file("page's tokens", tokens)))
        if web.tls_key:
            key = keyfiles.look_at_file("page's TLS key", Path(web.tls_key))
            out.append(keyfiles.tls_key_file(key))
    for source in config.sources:
        if source.key_file:
            file = keyfiles.look_at_file(f"{source.kind} key", Path(source.key_file).expanduser())
            out.append(keyfiles.secret_file(file))
    if switch := config.operator.enable_input:
        file = keyfiles.look_at_file("enable switch", Path(switch))
        out.append(keyfiles.enable_switch(file))
    return out


def configuration(config: Config, path: Path) -> Finding:
    """Whether the configuration as a whole holds."""
    try:
        resolved: dict[str, Any] = resolve(config, run_dir_of(config))
    except ConfigError as error:
        return Finding(
            "configuration", Level.PROBLEM, f"{error.where}: {error.what}",
            "the server will not start", error.do,
        )  # fmt: skip
    rate = resolved["platform"]["rate_hz"]
    return Finding(
        "configuration", Level.OK, f"{path}: valid, {rate:g} packets/s", "it can be started with"
    )


def wanted_addresses(config: Config) -> list[addresses.Address]:
    """Every address the server will bind, the platform's first."""
    platform, web = config.platform, config.web
    key = "[platform] local_host, local_port"
    host, port = platform.local_host, platform.local_port
    out = [addresses.Address("platform's address", key, "udp", host, port)]
    for source in config.sources:
        key = f"[[sources]] {source.kind} listen"
        host, port = split_address(source.listen)
        protocol = "tcp" if source.kind == "zenoh" else "udp"
        out.append(addresses.Address(f"{source.kind} source", key, protocol, host, port))
    if web.enabled:
        key = "[web] host, port"
        out.append(addresses.Address("page's address", key, "tcp", web.host, web.port))
    return out
