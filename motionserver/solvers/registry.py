"""Backends by name."""

from __future__ import annotations

from importlib import import_module
from typing import Any, Final

from motionserver.errors import TunableError
from motionserver.solvers.base import QpBackend
from motionserver.solvers.stage import StageBackend

BACKENDS: Final = {
    "daqp": ("motionserver.solvers.daqp", "Daqp"),
    "osqp": ("motionserver.solvers.osqp", "Osqp"),
    "piqp": ("motionserver.solvers.piqp", "Piqp"),
    "hpipm": ("motionserver.solvers.hpipm", "Hpipm"),
}
"""Module and class of every backend; imported when first asked for."""

REFERENCE: Final = "reference"
"""Name of a backend that may take its time and errs by 1e-9: for benchmarks and tests."""

STAGED: Final = {"hpipm": ("motionserver.solvers.hpipm", "HpipmStages")}
"""Module and class of those that also solve programmes by stages."""

INEXACT: Final = frozenset({"osqp"})
"""Backends that stop at a tolerance which can be felt."""

OPTIONAL: Final = frozenset({"hpipm"})
"""Backends whose library is an extra of the package."""


def present(name: str) -> bool:
    """Whether a backend of `BACKENDS` can be made here."""
    try:
        make_backend(name)
    except ValueError:
        return False
    return True


def make_backend(
    name: str, iterations: int | None = None, tolerance: float | None = None
) -> QpBackend:
    """Make a fresh backend.

    Args:
        name: One of `BACKENDS`, or `REFERENCE`.
        iterations: Fixed budget of iterations; None is the backend's own. See `QpBackend` for what
            a result is worth when it is used up.
        tolerance: Of a method that is inexact; the others need none.

    Raises:
        ValueError: There is no such backend, its library cannot be imported, or the budget is not
            positive.
    """
    if name == REFERENCE:
        # not among the backends: nobody shall drive with it
        return _make("piqp", {"iterations": iterations or 200, "tolerance": 1e-9})
    if name not in BACKENDS:
        raise TunableError("backend", f"QP backend {name!r} does not exist", ", ".join(BACKENDS))
    if iterations is not None and iterations < 1:
        raise ValueError(
            f"QP backend {name!r}: a budget of {iterations} iterations finds nothing; allowed is "
            "1 or more, or None for the backend's own"
        )
    options: dict[str, Any] = {} if iterations is None else {"iterations": iterations}
    if tolerance is not None and name in INEXACT:
        options["tolerance"] = tolerance
    return _make(name, options)


def make_stage_backend(name: str, iterations: int | None = None) -> StageBackend:
    """Make a fresh solver of stage programmes.

    Args:
        name: One of `STAGED`.
        iterations: Fixed budget of iterations; None is the backend's own.

    Raises:
        ValueError: There is no such backend, or its library cannot be imported.
    """
    if name not in STAGED:
        raise ValueError(f"stage backend {name!r} does not exist; allowed: {', '.join(STAGED)}")
    options = {} if iterations is None else {"iterations": iterations}
    backend: StageBackend = _made(name, STAGED[name], options)
    return backend


def _make(name: str, options: dict[str, Any]) -> QpBackend:
    backend: QpBackend = _made(name, BACKENDS[name], options)
    return backend


def _made(name: str, where: tuple[str, str], options: dict[str, Any]) -> Any:  # noqa: ANN401
    module, cls = where
    try:
        return getattr(import_module(module), cls)(**options)
    except (ImportError, OSError) as error:  # a library beside the module may be missing or broken
        package = f"motionserver[{name}]" if name in OPTIONAL else name
        others = ", ".join(o for o in BACKENDS if o not in OPTIONAL and o != name)
        raise TunableError(
            "backend",
            f"QP backend {name!r} cannot be loaded ({error})",
            f"{name} after pip install '{package}', or one of {others}",
        ) from error
