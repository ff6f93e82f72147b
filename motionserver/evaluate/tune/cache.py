"""Results kept on disk, one line each: a search that was stopped goes on where it was."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import fields
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import TracebackType
from typing import Any, Final

import numpy as np

import motionserver
from motionserver.bounded_files import MIB, read_bounded_text
from motionserver.errors import ConfigError
from motionserver.evaluate.tune.outcome import Job, Outcome

LARGEST_CACHE: Final = 1024 * MIB
_SOURCES: Final = (
    "core/**/*.py",
    "cueing/**/*.py",
    "solvers/**/*.py",
    "bounded_files.py",
    "errors.py",
    "evaluate/disturbance.py",
    "evaluate/drive.py",
    "evaluate/hearing.py",
    "evaluate/live.py",
    "evaluate/lockstep.py",
    "evaluate/recording.py",
    "evaluate/metrics/*.py",
    "evaluate/tune/outcome.py",
    "evaluate/tune/sickness.py",
    "evaluate/tune/stretches.py",
)
"""What turns a recording into figures, and not what draws them."""
_LIBRARIES: Final = ("numpy", "scipy", "daqp", "osqp", "piqp", "casadi")
"""Distributions that count; casadi brings the library of hpipm."""


class ResultCache:
    """Outcomes by what they depend on; a line is written as soon as it is known.

    Args:
        path: File of JSON lines, made if missing.

    Raises:
        ConfigError: It cannot be read or written.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._known = dict(self._lines())
        try:
            self._stream = path.open("a", encoding="utf-8")
        except OSError as error:
            raise _unusable(path, error) from error

    def __enter__(self) -> ResultCache:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._stream.close()

    def get(self, key: str) -> Outcome | None:
        """What is known."""
        return self._known.get(key)

    def put(self, key: str, outcome: Outcome, note: str) -> None:
        """Keep a result; ``note`` is for whoever reads the file."""
        self._known[key] = outcome
        line = {"key": key, "note": note, "outcome": outcome.to_mapping()}
        self._stream.write(json.dumps(line) + "\n")
        self._stream.flush()

    def _lines(self) -> Iterator[tuple[str, Outcome]]:
        try:
            text = read_bounded_text(self._path, LARGEST_CACHE) if self._path.exists() else ""
        except (OSError, UnicodeDecodeError) as error:
            raise _unusable(self._path, error) from error
        for line in text.splitlines():
            try:
                data = json.loads(line)
                yield data["key"], Outcome.from_mapping(data["outcome"])
            except (ValueError, KeyError, TypeError):
                continue  # cut short when the power went, or of an older layout: driven again
        if text and not text.endswith("\n"):
            with self._path.open("a", encoding="utf-8") as stream:
                stream.write("\n")


def key_of(job: Job) -> str:
    """Hash of everything an outcome depends on: values, machine, drive, code, libraries."""
    what = {
        "tuning": {f.name: _exact(getattr(job.tuning, f.name)) for f in fields(job.tuning)},
        "machine": job.machine.digest,
        "stretch": job.stretch.digest,
        "wanted_scale": repr(job.wanted_scale),
        "planner_hz": repr(job.planner_hz),
        "code": code_digest(),
    }
    return hashlib.sha256(json.dumps(what, sort_keys=True).encode()).hexdigest()[:24]


@cache
def code_digest() -> str:
    """Hash of the source that turns a recording into figures, and of the libraries' versions."""
    root = Path(motionserver.__file__).parent
    text = hashlib.sha256()
    for path in (path for pattern in _SOURCES for path in sorted(root.glob(pattern))):
        text.update(path.relative_to(root).as_posix().encode())
        text.update(path.read_bytes())
    for name in _LIBRARIES:
        text.update(f"{name}={_version(name)}".encode())
    return text.hexdigest()[:16]


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "none"


def _exact(value: Any) -> str:  # noqa: ANN401  (any field of a tuning)
    return value.tobytes().hex() if isinstance(value, np.ndarray) else repr(value)


def _unusable(path: Path, error: Exception) -> ConfigError:
    return ConfigError(f"--out {path.parent}", f"{path.name}: {error}", "Name a writable folder.")
