"""Python, the libraries and what spreads over the processors."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import Final

from motionserver.doctor.finding import Finding, Level

REQUIRED: Final = {
    "numpy": "2.0",
    "scipy": "1.13",
    "osqp": "1.0",
    "daqp": "0.7",
    "piqp": "0.6",
    "eclipse-zenoh": "1.4",
    "pydantic": "2.10",
    "pydantic-settings": "2.7",
    "fastapi": "0.135",
    "uvicorn": "0.36",
    "typer": "0.15",
    "prometheus-client": "0.21",
    "tomli-w": "1.1",
}
"""Oldest version of each library, as pyproject.toml asks for."""
OLDEST_PYTHON: Final = (3, 11)
THREADS: Final = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
"""Variables the service sets to 1 for its processes, unless somebody set them before."""


@dataclass(frozen=True, slots=True)
class Software:
    """What is installed.

    Attributes:
        python: Version of the interpreter.
        libraries: Version of each library, None for one that is not installed.
        backends: Whether each optional solver can be loaded.
    """

    python: tuple[int, int, int]
    libraries: Mapping[str, str | None]
    backends: Mapping[str, bool]


def installed() -> Software:
    """Read what is installed."""
    from motionserver.solvers.registry import OPTIONAL, present

    return Software(
        sys.version_info[:3],
        {name: _version(name) for name in REQUIRED},
        {name: present(name) for name in sorted(OPTIONAL)},
    )


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def numbers(text: str) -> tuple[int, ...]:
    """The leading numbers of a version: "1.4.0rc1" is (1, 4, 0)."""
    out = []
    for part in text.split("."):
        digits = re.match(r"\d+", part)
        if digits is None:
            break
        out.append(int(digits[0]))
        if digits[0] != part:
            break
    return tuple(out)


def python(software: Software) -> Finding:
    """The interpreter's version."""
    found = ".".join(map(str, software.python))
    if software.python[:2] >= OLDEST_PYTHON:
        return Finding("Python", Level.OK, found, "as asked for")
    oldest = ".".join(map(str, OLDEST_PYTHON))
    return Finding(
        "Python", Level.PROBLEM, found, f"{oldest} or newer is asked for",
        f"python{oldest} -m venv VENV && VENV/bin/pip install motionserver",
    )  # fmt: skip


def libraries(software: Software) -> Finding:
    """The libraries' versions against the oldest that are asked for."""
    missing = [name for name, found in software.libraries.items() if found is None]
    old = [
        name
        for name, found in software.libraries.items()
        if found is not None and numbers(found) < numbers(REQUIRED[name])
    ]
    if not missing and not old:
        found = ", ".join(f"{name} {shown}" for name, shown in software.libraries.items())
        return Finding("libraries", Level.OK, found, "as asked for")
    parts = [f"{name} missing" for name in missing]
    parts += [
        f"{name} {software.libraries[name]}, {REQUIRED[name]} or newer wanted" for name in old
    ]
    wanted = " ".join(f"'{name}>={REQUIRED[name]}'" for name in [*missing, *old])
    return Finding(
        "libraries", Level.PROBLEM, "; ".join(parts), "some commands or solvers do not start",
        f"{sys.executable} -m pip install {wanted}",
    )  # fmt: skip


def optional_backends(software: Software, wanted: str | None) -> Finding:
    """Solvers that come as extras.

    Args:
        software: What is installed.
        wanted: The solver that the configuration names; None if it names none.
    """
    name = "optional solvers"
    found = ", ".join(
        f"{backend} {'present' if there else 'absent'}"
        for backend, there in software.backends.items()
    )
    if wanted is not None and software.backends.get(wanted) is False:
        return Finding(
            name, Level.PROBLEM, f"{found}; the configuration wants {wanted}",
            "the planner cannot make it: no plans, the platform is not raised",
            f"{sys.executable} -m pip install 'motionserver[{wanted}]'",
        )  # fmt: skip
    return Finding(name, Level.OK, found, "the others come with the package")


def blas_threads(environment: Mapping[str, str]) -> Finding:
    """Whether a variable lets matrix products spread over the processors."""
    name = "BLAS threads"
    wrong = {key: environment[key] for key in THREADS if environment.get(key, "1") != "1"}
    if not wrong:
        return Finding(
            name, Level.OK, "one for each process, as the service sets it",
            "planner and guard do not take each other's processor",
        )  # fmt: skip
    return Finding(
        name, Level.WARNING, ", ".join(f"{key}={value}" for key, value in wrong.items()),
        "the service leaves it as it is: products of the planner spread onto the guard's processor",
        "unset " + " ".join(wrong),
    )  # fmt: skip
