"""Backends by name."""

from __future__ import annotations

from importlib import import_module
from typing import Any, Final

from motionserver.solvers.base import QpBackend

BACKENDS: Final = {
    "daqp": ("motionserver.solvers.daqp", "Daqp"),
    "osqp": ("motionserver.solvers.osqp", "Osqp"),
    "piqp": ("motionserver.solvers.piqp", "Piqp"),
    "hpipm": ("motionserver.solvers.hpipm", "Hpipm"),
}
"""Module and class of every backend; imported when first asked for."""

REFERENCE: Final = "reference"
"""Name of a backend that may take its time and errs by 1e-9: for benchmarks and tests."""

OPTIONAL: Final = frozenset({"hpipm"})
"""Backends whose library is an extra of the package."""


def present(name: str) -> bool:
    """Whether a backend of `BACKENDS` can be made here."""
    try:
        make_backend(name)
    except ValueError:
        return False
    return True


def make_backend(name: str, iterations: int | None = None) -> QpBackend:
    """Make a fresh backend.

    Args:
        name: One of `BACKENDS`, or `REFERENCE`.
        iterations: Fixed budget of iterations; None is the backend's own. See `QpBackend` for what
            a result is worth when it is used up.

    Raises:
        ValueError: There is no such backend, its library cannot be imported, or the budget is not
            positive.
    """
    if name == REFERENCE:
        # not among the backends: nobody shall drive with it
        return _make("piqp", {"iterations": iterations or 200, "tolerance": 1e-9})
    if name not in BACKENDS:
        raise ValueError(
            f"QP backend {name!r} does not exist; allowed: {', '.join(BACKENDS)}; "
            "change tuning.backend"
        )
    if iterations is not None and iterations < 1:
        raise ValueError(
            f"QP backend {name!r}: a budget of {iterations} iterations finds nothing; allowed is "
            "1 or more, or None for the backend's own"
        )
    return _make(name, {} if iterations is None else {"iterations": iterations})


def _make(name: str, options: dict[str, Any]) -> QpBackend:
    module, cls = BACKENDS[name]
    try:
        backend: QpBackend = getattr(import_module(module), cls)(**options)
    except ImportError as error:
        what = f"motionserver[{name}]" if name in OPTIONAL else name
        others = ", ".join(other for other in BACKENDS if other not in OPTIONAL)
        raise ValueError(
            f"QP backend {name!r} cannot be loaded ({error}); pip install '{what}', or change "
            f"tuning.backend to one of {others}"
        ) from error
    return backend
