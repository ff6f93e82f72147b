"""Platform formats by name: ours, and third parties' by entry point."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import entry_points
from typing import Final

from motionserver.errors import ConfigError, PluginError
from motionserver.platforms.base import PlatformFormat, PlatformOptions
from motionserver.platforms.moog import Moog6Dof2000E

GROUP: Final = "motionserver.platforms"

_OURS: Final[dict[str, Callable[[PlatformOptions], PlatformFormat]]] = {
    Moog6Dof2000E.name: Moog6Dof2000E
}


def platform_names() -> list[str]:
    """Names that `make_platform` knows."""
    return sorted({*_OURS, *(point.name for point in entry_points(group=GROUP))})


def make_platform(name: str, options: PlatformOptions) -> PlatformFormat:
    """Make a format.

    Args:
        name: As in ``[platform] format``.
        options: How this machine differs.

    Raises:
        ConfigError: No format has this name.
        PluginError: A third party's format does not load.
    """
    if name in _OURS:
        return _OURS[name](options)
    for point in entry_points(group=GROUP):
        if point.name == name:
            try:
                made: PlatformFormat = point.load()(options)
            except Exception as error:
                raise PluginError(f"platform format {name!r} ({point.value}): {error}") from error
            return made
    raise ConfigError(
        "[platform] format", f"unknown {name!r}", f"Allowed: {', '.join(platform_names())}"
    )
