"""Configurations that are well formed and with which nothing can work: refused, or warned of."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from motionserver.bounded_files import SETTINGS_BYTES, check_regular
from motionserver.core.limits import Machine
from motionserver.errors import ConfigError
from motionserver.settings.address_rules import check_addresses
from motionserver.settings.config import Config, state_dir_of
from motionserver.settings.keys import split_address
from motionserver.settings.machine_sense import farthest_head
from motionserver.settings.sections import SourceSection

MOOG: Final = "moog-6dof2000e"
_OFFSET_SLACK: Final = 0.005
"""How much shorter than a Moog's zero a leg may be declared: two published zeros differ by half
of that [m]."""
_HEAVE_WORDS: Final = 0.5
"""Largest heave word of a Moog at neutral; its travel is 0.4572 [m]."""
_FAR_HEAD: Final = 6.0
"""Distance of the driver's head from the sent point that is worth a question [m]."""
_ENDPOINT: Final = re.compile(r"[a-z][a-z0-9_-]*/(\[[0-9a-fA-F:.%]+\]|[^\s:/?#\[\]]+):[0-9]{1,5}")
_NAMED_ENDPOINT: Final = re.compile(r"(serial|unixsock-stream|unixpipe|vsock)/\S+")


def check_usable(config: Config, machine: Machine, run_dir: Path) -> None:
    """Refuse what is well formed and cannot work.

    Args:
        config: The configuration.
        machine: Its machine, the configured head included.
        run_dir: Where the processes meet.

    Raises:
        ConfigError: One such thing; the key is named.
    """
    _check_folders(config, run_dir)
    _check_words(config, machine)
    _check_sources(config.sources)
    check_addresses(config.platform, config.sources, config.web)
    _check_switch(config)
    for name in config.web.allowed_hosts:
        if not name or set(name) & set("/*? @") or (":" in name and not name.startswith("[")):
            raise ConfigError(
                "[web] allowed_hosts",
                f"{name!r} is no host name: nobody asks for that name",
                "Give names alone, without scheme, port or wildcard, such as simulator.lan.",
            )


def doubts(config: Config, machine: Machine) -> Iterator[str]:
    """What works and is probably not meant, one sentence each."""
    platform, cueing = config.platform, config.cueing
    if cueing.scale == 0.0:
        yield "[cueing] scale = 0: the platform will not move; the page can raise it"
    if platform.mode == "length" and platform.length_offset_m == 0.0:
        yield (
            "[platform] length_offset_m = 0: words are whole pin-to-pin lengths, "
            f"{machine.leg_min:g} to {machine.leg_max:g} m; a Moog base expects the extension, "
            "so leave the key out for it"
        )
    if float(np.linalg.norm(cueing.vehicle_head_m)) > _FAR_HEAD:
        yield (
            f"[cueing] vehicle_head_m is {np.linalg.norm(cueing.vehicle_head_m):.3g} m from the "
            "point whose motion is sent; is that meant?"
        )
    for source in config.sources:
        if split_address(source.listen)[1] == 0:
            yield (
                f"[[sources]] {source.kind} {source.listen}: port 0 is any free one, so that no "
                "sender can know it"
            )
    if config.operator.engage == "http" and not config.web.enabled:
        yield '[operator] engage = "http" without a page: only the console can engage'


def _check_folders(config: Config, run_dir: Path) -> None:
    state, run = state_dir_of(config).absolute(), run_dir.absolute()
    if state.exists() and not state.is_dir():
        raise ConfigError("[server] state_dir", f"{state} is no folder", "Name a folder.")
    if state == run or run in state.parents or state / "blackbox" in (run, *run.parents):
        raise ConfigError(
            "[server] state_dir",
            f"{state} and run_dir = {run} share a folder: what must outlive a run would be deleted "
            "with it",
            "Give two folders that do not contain each other.",
        )


def _check_words(config: Config, machine: Machine) -> None:
    """Whether the words of the packets can be those of this machine."""
    platform = config.platform
    head, most = float(np.linalg.norm(machine.head)), farthest_head(machine.platform_joints)
    if head > most:
        raise ConfigError(
            "[platform] head_m",
            f"the head is {head:.3g} m from the reference point, allowed is {most:.3g} m",
            "Give it from the motion reference point, in m.",
        )
    neutral = platform.heave_neutral_m
    if platform.mode == "dof" and platform.format == MOOG and abs(neutral) > _HEAVE_WORDS:
        raise ConfigError(
            "[platform] heave_neutral_m",
            f"{neutral:g} m is beyond the base's travel, allowed is -{_HEAVE_WORDS:g} to "
            f"{_HEAVE_WORDS:g} m",
            "Give -0.2286, or 0 for software revision E16.",
        )
    offset = platform.length_offset_m
    if platform.mode != "length" or not offset:
        return
    stroke = machine.leg_max - machine.leg_min
    low = machine.leg_min - 2.0 * stroke
    high = machine.leg_min + _OFFSET_SLACK if platform.format == MOOG else machine.leg_max
    if not low <= offset <= high:
        raise ConfigError(
            "[platform] length_offset_m",
            f"{offset:g} m would make words of {machine.leg_min - offset:.4g} to "
            f"{machine.leg_max - offset:.4g} m of legs with a stroke of {stroke:.4g} m, allowed is "
            f"{max(low, 0.0):.4g} to {high:.4g} m",
            f"Give the pin-to-pin length of a retracted leg, or leave the key out: it then is "
            f"{machine.leg_min:g}.",
        )


def _check_sources(sources: list[SourceSection]) -> None:
    if all(source.kind == "imu" for source in sources):
        raise ConfigError(
            "[[sources]]",
            "no source of cues: nothing can ever drive the platform"
            if not sources
            else "only sensors: nothing can ever drive the platform",
            'Add a source, such as kind = "native", listen = "127.0.0.1:4600".',
        )
    cues = {source.topic for source in sources if source.kind == "zenoh"}
    for source in sources:
        where = f"[[sources]] {source.kind} {source.listen}"
        if source.kind != "zenoh":
            for key in ("topic", "connect"):
                # the default written out, as in the annotated file, asks for nothing
                if getattr(source, key) not in ("", [], SourceSection.model_fields[key].default):
                    raise ConfigError(
                        f"{where}: {key}",
                        'would do nothing: it needs kind = "zenoh"',
                        "Remove it, or change the kind.",
                    )
            continue
        _check_topic(f"{where}: topic", source.topic)
        if source.preview_topic:
            _check_topic(f"{where}: preview_topic", source.preview_topic)
            status = {f"{topic.rsplit('/in/', 1)[0]}/status" for topic in cues}
            if source.preview_topic in cues | status:
                raise ConfigError(
                    f"{where}: preview_topic",
                    f"{source.preview_topic!r} is a key that cues or this server's status are put "
                    "on",
                    "Give previews a key of their own.",
                )
        for endpoint in source.connect:
            if not (_ENDPOINT.fullmatch(endpoint) or _NAMED_ENDPOINT.fullmatch(endpoint)):
                raise ConfigError(
                    f"{where}: connect",
                    f"{endpoint!r} is no endpoint",
                    "Write it like tcp/192.0.2.7:7447.",
                )


def _check_topic(where: str, topic: str) -> None:
    parts = topic.split("/")
    if set(topic) & set("*$?#") or not all(parts) or any(part.isspace() for part in parts):
        wild = ": with wildcards, whatever anybody puts would arrive here" if "*" in topic else ""
        raise ConfigError(
            where,
            f"{topic!r} is no single key{wild}",
            "Give names between single slashes, without * $ ? #, such as motion/0/in/cue.",
        )


def _check_switch(config: Config) -> None:
    switch = config.operator.enable_input
    if not switch:
        return
    path = Path(switch).expanduser()
    try:
        check_regular(path, SETTINGS_BYTES)
        problem = "" if os.access(path, os.R_OK) else "this user may not read it"
    except OSError as error:
        problem = str(error.strerror)
    if problem:
        raise ConfigError(
            "[operator] enable_input",
            f"{path}: {problem}: it would count as released, and nobody could engage from the page",
            "Give the file of the enable switch, such as /sys/class/gpio/gpio17/value, exported "
            "and readable; or leave the key out.",
        )
