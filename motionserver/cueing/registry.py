"""Cueing algorithms by name: two of ours, any number of others by entry point."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import EntryPoint, entry_points
from typing import Final

from motionserver.core.limits import Machine
from motionserver.cueing.base import Cueing
from motionserver.cueing.classical import Classical
from motionserver.cueing.mpc import SixAxis
from motionserver.cueing.thondel import Thondel
from motionserver.cueing.tuning import Tuning

Maker = Callable[[Machine, Tuning, float], Cueing]
"""Machine, tunables, planner period [s] -> algorithm."""

GROUP: Final = "motionserver.cueing"
"""Entry-point group of third parties; each entry names a `Maker`."""
BUILT_IN: Final[dict[str, Maker]] = {
    SixAxis.name: SixAxis,
    Classical.name: Classical,
    Thondel.name: Thondel,
}


def algorithms() -> tuple[str, ...]:
    """Names that may stand in the tuning, ours first."""
    return (*BUILT_IN, *(entry.name for entry in _plugins() if entry.name not in BUILT_IN))


def make_cueing(machine: Machine, tuning: Tuning, period: float) -> Cueing:
    """Make the algorithm the tuning names.

    Args:
        machine: Geometry and limits.
        tuning: Tunables; ``algorithm`` chooses.
        period: Planner period [s].

    Raises:
        ValueError: There is no such algorithm, or its plug-in does not load.
    """
    name = tuning.algorithm
    maker = BUILT_IN.get(name) or _load(name)
    return maker(machine, tuning, period)


def _plugins() -> list[EntryPoint]:
    return sorted(entry_points(group=GROUP), key=lambda entry: entry.name)


def _load(name: str) -> Maker:
    for entry in _plugins():
        if entry.name != name:
            continue
        try:
            maker: Maker = entry.load()
        except Exception as error:
            raise ValueError(
                f"cueing plug-in {name!r} ({entry.value}) does not load: "
                f"{type(error).__name__}: {error}; repair or remove the package that brings it"
            ) from error
        return maker
    raise ValueError(
        f"cueing algorithm {name!r} does not exist; allowed: {', '.join(algorithms())}; "
        "change tuning.algorithm"
    )
