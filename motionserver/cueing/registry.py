"""Cueing algorithms by name: two of ours, any number of others by entry point."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import entry_points
from typing import Final

from motionserver.core.limits import Machine
from motionserver.cueing.base import Cueing
from motionserver.cueing.thondel import Thondel
from motionserver.cueing.tuning import Tuning

Maker = Callable[[Machine, Tuning, float], Cueing]
"""Machine, tunables, planner period [s] -> algorithm."""

GROUP: Final = "motionserver.cueing"
"""Entry-point group of third parties; each entry names a `Maker`."""
BUILT_IN: Final[dict[str, Maker]] = {Thondel.name: Thondel}
