"""Cueing algorithms by name: three of ours, any number of others by entry point.

An algorithm declares which tunables it reads, as attributes of what its entry point names:
``tunables``, a set of names of `Tuning` (without `COMMON`, which acts in front of all), and
``Options``, a pydantic model of tunables that only it has. Who declares nothing may read them all.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Final

from motionserver.core.limits import Machine
from motionserver.cueing.base import Cueing
from motionserver.cueing.classical import Classical
from motionserver.cueing.mpc import SixAxis
from motionserver.cueing.thondel import Thondel
from motionserver.cueing.tuning import COMMON, TUNABLES, Tuning
from motionserver.errors import TunableError

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
        TunableError: There is no such algorithm, its plug-in does not load, or a tunable has a
            value with which it cannot be made here.
    """
    return maker_of(tuning.algorithm)(machine, tuning, period)


def maker_of(name: str) -> Maker:
    """What makes an algorithm, and declares its tunables.

    Raises:
        TunableError: There is no such algorithm, or its plug-in does not load.
    """
    return BUILT_IN.get(name) or _load(name)


def tunables_of(name: str) -> frozenset[str]:
    """Names in `Tuning` that an algorithm reads, `COMMON` ones included.

    Raises:
        TunableError: There is no such algorithm, its plug-in does not load, or it declares
            tunables that do not exist.
    """
    declared = getattr(maker_of(name), "tunables", None)
    if declared is None:
        return TUNABLES
    unknown = sorted(set(declared) - TUNABLES)
    if unknown:
        raise TunableError(
            "algorithm",
            f"cueing plug-in {name!r} declares tunables that do not exist: {', '.join(unknown)}",
            "names of motionserver.cueing.tuning.Tuning; its own belong into its class Options",
        )
    return frozenset(declared) | COMMON


def options_of(name: str) -> Any:  # noqa: ANN401  (a pydantic model class, which cueing does not import)
    """Model of the tunables that only this algorithm has; None if it has none.

    Raises:
        TunableError: There is no such algorithm, or its plug-in does not load.
    """
    return getattr(maker_of(name), "Options", None)


@cache
def _plugins() -> list[EntryPoint]:
    return sorted(entry_points(group=GROUP), key=lambda entry: entry.name)


def _load(name: str) -> Maker:
    for entry in _plugins():
        if entry.name != name:
            continue
        try:
            maker: Maker = entry.load()
        except Exception as error:
            raise TunableError(
                "algorithm",
                f"cueing plug-in {name!r} ({entry.value}) does not load: "
                f"{type(error).__name__}: {error}; repair or remove the package that brings it",
                ", ".join(other for other in algorithms() if other != name),
            ) from error
        return maker
    raise TunableError(
        "algorithm", f"cueing algorithm {name!r} does not exist", ", ".join(algorithms())
    )
