"""Simulator formats by name: ours, and third parties' by entry point."""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import Final

from motionserver.errors import ConfigError, PluginError
from motionserver.sources.base import SourceFormat
from motionserver.sources.beamng import BeamNgSource
from motionserver.sources.native import NativeSource

GROUP: Final = "motionserver.sources"


def source_names() -> list[str]:
    """Names that `make_source` knows."""
    names = {"native", "zenoh", "imu", "beamng"}
    return sorted({*names, *(point.name for point in entry_points(group=GROUP))})


def make_source(kind: str, key: bytes | None) -> SourceFormat:
    """Make the decoder of one input.

    Args:
        kind: As in ``[[sources]] kind``; native, zenoh and imu carry the same packet.
        key: Key of signed packets, if any.

    Raises:
        ConfigError: No format has this name.
        PluginError: A third party's format does not load.
    """
    if kind in ("native", "zenoh", "imu"):
        return NativeSource(key)
    if kind == "beamng":
        return BeamNgSource()
    for point in entry_points(group=GROUP):
        if point.name == kind:
            try:
                made: SourceFormat = point.load()()
            except Exception as error:
                raise PluginError(f"source {kind!r} ({point.value}): {error}") from error
            return made
    raise ConfigError(
        "[[sources]] kind", f"unknown {kind!r}", f"Allowed: {', '.join(source_names())}"
    )
