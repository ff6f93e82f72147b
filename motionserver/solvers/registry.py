"""Backends by name."""

from __future__ import annotations

from importlib import import_module
from typing import Final

from motionserver.solvers.base import QpBackend

BACKENDS: Final = {
    "daqp": ("motionserver.solvers.daqp", "Daqp"),
    "osqp": ("motionserver.solvers.osqp", "Osqp"),
    "piqp": ("motionserver.solvers.piqp", "Piqp"),
}
"""Module and class of every backend; imported when first asked for."""


def make_backend(name: str) -> QpBackend:
    """Make a fresh backend.

    Args:
        name: One of `BACKENDS`.

    Raises:
        ValueError: There is no such backend, or its library cannot be imported.
    """
    if name not in BACKENDS:
        raise ValueError(
            f"QP backend {name!r} does not exist; allowed: {', '.join(BACKENDS)}; "
            "change tuning.backend"
        )
    module, cls = BACKENDS[name]
    try:
        backend: QpBackend = getattr(import_module(module), cls)()
    except ImportError as error:
        raise ValueError(
            f"QP backend {name!r} cannot be imported ({error}); install the library "
            f"{name!r} or choose another of {', '.join(BACKENDS)}"
        ) from error
    return backend
